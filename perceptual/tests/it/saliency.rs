//! Saliency: what stands out is found, what is flat stays flat, and nothing panics.
