"""The near-infrared camera, from radiance to digital numbers."""
