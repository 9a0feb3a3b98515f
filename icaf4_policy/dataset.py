"""Samples as items to train on, for torch's data loaders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from torch.utils.data import Dataset, Sampler

from artgym.datasets.sample import Sample
from icaf4_policy.anchors import Anchors
from icaf4_policy.features import DEFAULT_FEATURES, Features
from icaf4_policy.targets import DrawConfig, Item, Targets, draw_item, targets_from_sample

#: Of a sample's points, at most this many times ``num_points`` are kept to draw from.
SPARE_POINTS = 3


class TrainingItems(Dataset[Item]):
    """Samples as clouds of ``num_points`` points with all targets, chosen anew in each epoch.

    Index ``epoch * n + i`` is sample i of n in that epoch: what an item holds follows from it and
    the seed alone, with any number of workers. The targets of a sample are worked out when it is
    first asked for, and kept, so that later epochs read no file.

    >>> import functools
    >>> from torch.utils.data import DataLoader
    >>> from icaf4_policy.targets import collate_items
    >>> def loader(items: TrainingItems) -> DataLoader:
    ...     return DataLoader(
    ...         items,
    ...         batch_size=8,
    ...         sampler=EpochSampler(len(items)),
    ...         collate_fn=functools.partial(collate_items, config=items.config),
    ...         num_workers=1,
    ...         persistent_workers=True,
    ...     )

    Args:
        samples: such as a ``SampleFolder``, which is read lazily.
        categories: those that the network is for.
        anchors: what successful grasps are matched with.
        config: how points are chosen.
        features: what the network is given of each point.
        seed: of the choice.
    """

    def __init__(
        self,
        samples: Sequence[Sample],
        categories: Sequence[str],
        anchors: Anchors,
        config: DrawConfig,
        *,
        features: Features = DEFAULT_FEATURES,
        seed: int = 0,
    ) -> None:
        self.config = config
        self._samples, self._categories = samples, categories
        self._features: Features = features
        self._anchors, self._seed = anchors, seed
        self._targets: dict[int, Targets] = {}

    def __len__(self) -> int:
        """The number of samples."""
        return len(self._samples)

    def __getitem__(self, index: int) -> Item:
        """The arrays of one item; see ``icaf4_policy.targets.Batch``, without B."""
        if index < 0:
            raise IndexError(f"index {index}: expected 0 or more")
        epoch, number = divmod(index, len(self))
        if number not in self._targets:
            self._targets[number] = targets_from_sample(
                self._samples[number],
                self._categories,
                self._anchors,
                SPARE_POINTS * self.config.num_points,
                self._features,
            )
        rng = np.random.default_rng((self._seed, epoch, number))
        return draw_item(self._targets[number], self.config, rng)


class EpochSampler(Sampler[int]):
    """Every index of an epoch once, in an order of its own, as ``TrainingItems`` counts them.

    Args:
        count: items in an epoch.
        seed: of the orders.
        epoch: the first one; each pass is the next.
    """

    def __init__(self, count: int, *, seed: int = 0, epoch: int = 0) -> None:
        super().__init__()
        self._count, self._seed, self._epoch = count, seed, epoch

    def __len__(self) -> int:
        """Items in an epoch."""
        return self._count

    def __iter__(self) -> Iterator[int]:
        """The indices of the next epoch."""
        epoch, self._epoch = self._epoch, self._epoch + 1
        order = np.random.default_rng((self._seed, epoch)).permutation(self._count)
        yield from (epoch * self._count + order).tolist()
