//! Scenes, rays, photons and direct light: what there is to see in a frame.
