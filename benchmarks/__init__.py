"""One runnable script a question; each writes its answer to a JSON file under ``results/``."""
