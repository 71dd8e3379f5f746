//! Visibility thresholds from DCT masking, invertible tone mapping, picture metrics.
