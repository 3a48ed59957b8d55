"""The model of a whole vehicle, played back along flights and fitted on what it predicts."""
