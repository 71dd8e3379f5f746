//! Bit-exact serialization of values sent between ranks.

use glam::{Mat3A, Vec3, Vec3A};

/// A value that serializes without loss of precision.
pub trait Portable: Sized {
    /// Appends the value to `bytes`.
    fn put(&self, bytes: &mut Vec<u8>);

    /// Removes a value from the front of `bytes` and returns it, or returns `None` if `bytes` do not start with one.
    fn take(bytes: &mut &[u8]) -> Option<Self>;
}

/// Implements [`Portable`] for number types, in little-endian byte order.
macro_rules! portable_numbers {
    ($($number:ty),*) => {$(
        impl Portable for $number {
            fn put(&self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }

            fn take(bytes: &mut &[u8]) -> Option<Self> {
                let (own, rest) = bytes.split_first_chunk()?;
                *bytes = rest;
                Some(Self::from_le_bytes(*own))
            }
        }
    )*};
}

portable_numbers!(f32, f64, i64, u8, u16, u32, u64);

/// Implements [`Portable`](crate::Portable) for a struct, given all of its fields.
///
/// ```
/// # use ranks::portable;
/// struct Ray {
///     length: f32,
///     hits: u32,
/// }
/// portable!(Ray { length, hits });
/// ```
#[macro_export]
macro_rules! portable {
    ($name:ty { $($field:ident),* $(,)? }) => {
        impl $crate::Portable for $name {
            fn put(&self, bytes: &mut Vec<u8>) {
                $($crate::Portable::put(&self.$field, bytes);)*
            }

            fn take(bytes: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: $crate::Portable::take(bytes)?),* })
            }
        }
    };
}

impl Portable for usize {
    fn put(&self, bytes: &mut Vec<u8>) {
        (*self as u64).put(bytes);
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        u64::take(bytes)?.try_into().ok()
    }
}

impl Portable for bool {
    fn put(&self, bytes: &mut Vec<u8>) {
        bytes.push(u8::from(*self));
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        u8::take(bytes).map(|byte| byte != 0)
    }
}

impl<A: Portable, B: Portable> Portable for (A, B) {
    fn put(&self, bytes: &mut Vec<u8>) {
        self.0.put(bytes);
        self.1.put(bytes);
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        Some((A::take(bytes)?, B::take(bytes)?))
    }
}

impl<T: Portable, const N: usize> Portable for [T; N] {
    fn put(&self, bytes: &mut Vec<u8>) {
        self.iter().for_each(|value| value.put(bytes));
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        let values: [Option<T>; N] = std::array::from_fn(|_| T::take(bytes));
        // An array is complete only if all its elements are.
        values.iter().all(Option::is_some).then(|| values.map(|value| value.expect("each is there")))
    }
}

impl<T: Portable> Portable for Option<T> {
    fn put(&self, bytes: &mut Vec<u8>) {
        self.is_some().put(bytes);
        self.iter().for_each(|value| value.put(bytes));
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        match bool::take(bytes)? {
            true => T::take(bytes).map(Some),
            false => Some(None),
        }
    }
}

impl<T: Portable> Portable for Vec<T> {
    fn put(&self, bytes: &mut Vec<u8>) {
        (self.len() as u64).put(bytes);
        self.iter().for_each(|value| value.put(bytes));
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        let count = u64::take(bytes)?;
        // Collecting stops at the first missing element, so a wrong count reserves no memory.
        (0..count).map(|_| T::take(bytes)).collect()
    }
}

impl Portable for Vec3 {
    fn put(&self, bytes: &mut Vec<u8>) {
        self.to_array().put(bytes);
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        <[f32; 3]>::take(bytes).map(Self::from)
    }
}

impl Portable for Vec3A {
    fn put(&self, bytes: &mut Vec<u8>) {
        self.to_array().put(bytes);
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        <[f32; 3]>::take(bytes).map(Self::from)
    }
}

impl Portable for Mat3A {
    fn put(&self, bytes: &mut Vec<u8>) {
        self.to_cols_array().put(bytes);
    }

    fn take(bytes: &mut &[u8]) -> Option<Self> {
        <[f32; 9]>::take(bytes).map(|columns| Self::from_cols_array(&columns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After values of every type are serialized in sequence, deserialization returns the same bits and leaves no
    /// bytes.
    #[test]
    fn bits_come_back() {
        #[derive(Debug, PartialEq)]
        struct Mixed {
            matrix: Mat3A,
            list: Vec<Option<[u32; 2]>>,
            is_last: bool,
        }
        portable!(Mixed { matrix, list, is_last });
        let mixed = Mixed {
            matrix: Mat3A::from_cols_array(&std::array::from_fn(|k| k as f32 / 3.0)),
            list: vec![None, Some([7, u32::MAX])],
            is_last: true,
        };
        let odd = [f32::NEG_INFINITY, -0.0, f32::from_bits(1), f32::from_bits(0x7fc0_1234)];
        let mut bytes = Vec::new();
        mixed.put(&mut bytes);
        odd.put(&mut bytes);
        ((i64::MIN, 3u8), (Vec3::X, Vec3A::NEG_Z)).put(&mut bytes);

        let mut left = &bytes[..];
        assert_eq!(Mixed::take(&mut left), Some(mixed));
        assert_eq!(<[f32; 4]>::take(&mut left).map(|odd| odd.map(f32::to_bits)), Some(odd.map(f32::to_bits)));
        assert_eq!(Portable::take(&mut left), Some(((i64::MIN, 3u8), (Vec3::X, Vec3A::NEG_Z))));
        assert!(left.is_empty());
    }

    #[test]
    fn what_is_cut_short_is_no_value() {
        let mut bytes = Vec::new();
        vec![1.0f32, 2.0].put(&mut bytes);
        for length in 0..bytes.len() {
            assert_eq!(Vec::<f32>::take(&mut &bytes[..length]), None);
        }
    }
}
