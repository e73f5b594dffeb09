"""Heading from a gyro of low grade: drift removed by heuristics and by vision [Kyung et al. 2015]."""
