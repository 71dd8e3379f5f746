//! Zig-zag scanning order (7.3, alternate_scan = 0).

/// Raster position (`8 * v + u`) of the coefficients in transmission order, Figure 7-2.
pub(crate) const ZIGZAG: [usize; 64] = {
    let mut order = [0; 64];
    let (mut u, mut v) = (0usize, 0usize);
    let mut i = 0;
    while i < 64 {
        order[i] = 8 * v + u;
        // Even diagonals run up to the right, odd ones down to the left.
        if (u + v) % 2 == 0 {
            if u == 7 {
                v += 1;
            } else if v == 0 {
                u += 1;
            } else {
                u += 1;
                v -= 1;
            }
        } else if v == 7 {
            u += 1;
        } else if u == 0 {
            v += 1;
        } else {
            u -= 1;
            v += 1;
        }
        i += 1;
    }
    order
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_the_printed_one() {
        // Table of scan[0][v][u], as printed: the place in the order of each raster position.
        #[rustfmt::skip]
        let printed = [
            0, 1, 5, 6, 14, 15, 27, 28,
            2, 4, 7, 13, 16, 26, 29, 42,
            3, 8, 12, 17, 25, 30, 41, 43,
            9, 11, 18, 24, 31, 40, 44, 53,
            10, 19, 23, 32, 39, 45, 52, 54,
            20, 22, 33, 38, 46, 51, 55, 60,
            21, 34, 37, 47, 50, 56, 59, 61,
            35, 36, 48, 49, 57, 58, 62, 63,
        ];
        for (raster, &place) in printed.iter().enumerate() {
            assert_eq!(ZIGZAG[place], raster);
        }
    }
}
