"""What counts: success and reward, as pure functions of state."""
