"""What the training scripts share: settings, environments, networks, checkpoints, evaluation."""
