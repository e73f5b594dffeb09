"""What the rerun viewer opens: `episode.rrd`."""
