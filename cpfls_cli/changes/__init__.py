"""What has changed about a vehicle between flights."""
