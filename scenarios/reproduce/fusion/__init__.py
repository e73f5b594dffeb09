"""The belief against its own covariance, and what outages cost."""
