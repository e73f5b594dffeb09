"""From pixels to blobs with sub-pixel centres."""
