//! Tests that damaged, truncated and forged bytes give a one-line error.

use lightfield::{Field, FieldError, LookUp, NearLossless, Samples, Slot, TexelTiles};

/// Returns a small file of three tiles.
fn bytes() -> Vec<u8> {
    let tiles = TexelTiles::new(vec![[u64::MAX; 4], [0; 4], [0x00ff_00f0, 0, 7, 0]]);
    let codes = (0..tiles.texels() * 2 * 3).map(|k| (k * 7 / 5 % 256) as u8).collect();
    let field = Field::new(tiles, 2, Samples::Bytes(codes)).unwrap();
    NearLossless::encode(&field, 1).unwrap().as_bytes().to_vec()
}

fn message(bytes: Vec<u8>) -> String {
    let message = NearLossless::from_bytes(bytes).map(drop).unwrap_err().to_string();
    assert!(!message.contains('\n'), "{message}");
    message
}

#[test]
fn every_changed_byte_and_every_cut_is_told() {
    let whole = bytes();
    assert!(NearLossless::from_bytes(whole.clone()).is_ok());
    for place in 0..whole.len() {
        for bits in [1, 0x80, 0xff] {
            let mut changed = whole.clone();
            changed[place] ^= bits;
            message(changed);
        }
        message(whole[..place].to_vec());
    }
    let longer = [whole.as_slice(), &[0]].concat();
    assert!(message(longer).contains(&format!("has {} bytes", whole.len() + 1)));
}

#[test]
fn a_damaged_tile_is_named() {
    let mut changed = bytes();
    *changed.last_mut().unwrap() ^= 1;
    assert_eq!(message(changed), "tile 2 of the stored light field is damaged: store it again");
    let mut newer = bytes();
    newer[4] = 9;
    assert_eq!(message(newer), "stored light field of version 9, expected 1: store it again");
    assert_eq!(message(b"PNG and more of it".to_vec()), "these bytes are not a stored light field");
}

/// Every field of the header and every byte of the tiles is changed, with correct checksums. The file is rejected or
/// harmless.
#[test]
fn forged_bytes_are_refused_or_harmless() {
    let whole = bytes();
    let (list, tiles) = (24, 3);
    let end = list + tiles * 40;
    let mut refused = 0;
    for place in (4..end).chain(end + 4..whole.len()) {
        for value in [0, 1, 0x10, 0x7f, 0xff] {
            let mut forged = whole.clone();
            forged[place] = value;
            let mut from = end + 4;
            for tile in 0..tiles {
                let entry = list + tile * 40;
                let length = u32::from_le_bytes(whole[entry + 32..entry + 36].try_into().unwrap()) as usize;
                let sum = crc32fast::hash(&forged[from..from + length]).to_le_bytes();
                forged[entry + 36..entry + 40].copy_from_slice(&sum);
                from += length;
            }
            let sum = crc32fast::hash(&forged[..end]).to_le_bytes();
            forged[end..end + 4].copy_from_slice(&sum);
            let Ok(read) = NearLossless::from_bytes(forged) else {
                refused += 1;
                continue;
            };
            for slot in (0..read.tiles().len() * 256).map(Slot) {
                let there = read.tiles().rank(slot).is_some();
                assert_eq!(read.codes(slot, 0).is_some(), there);
            }
        }
    }
    assert!(refused > 300, "{refused}");
}

/// A tile of 1536 bytes is replaced by a frame of 16 MiB of zeros.
#[test]
fn a_tile_that_swells_is_refused() {
    let tiles = TexelTiles::of_picture(16, 16);
    let field = Field::new(tiles, 2, Samples::Bytes(vec![0; 1536])).unwrap();
    let stored = NearLossless::encode(&field, 0).unwrap().as_bytes().to_vec();
    let bomb = zstd::bulk::compress(&vec![0; 1 << 24], 19).unwrap();
    let mut forged = stored[..24 + 32].to_vec();
    forged.extend((bomb.len() as u32).to_le_bytes());
    forged.extend(crc32fast::hash(&bomb).to_le_bytes());
    forged.extend(crc32fast::hash(&forged).to_le_bytes());
    forged.extend(bomb);
    assert_eq!(NearLossless::from_bytes(forged).map(drop), Err(FieldError::Tile(0)));
}
