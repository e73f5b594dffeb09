"""One page of evidence from campaigns: rows, groups of flights that may be pooled, figures, the page."""
