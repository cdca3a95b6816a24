//! Signed images and keys: what a signature covers cannot change under it, and no bytes are a key by accident that breaks.
#![no_main]

use std::sync::LazyLock;

use sagnac_core::{SignatureBlock, Trusted};
use sagnac_signature::{Keyed, PublicKey, Signer};

/// A key of the target's own, and an image that it signed.
static SIGNED: LazyLock<(Signer, Vec<u8>)> = LazyLock::new(|| {
    let signer = Signer::from_seed(&[7; 32]);
    let image = include_bytes!("../../testdata/image/paper.img").to_vec();
    let block = signer.sign(&image, *b"RLG-28\0\0\0\0\0\0\0\0\0\0", 3).expect("an image is short enough");
    let whole = [&image[..], &block.encode()].concat();
    (signer, whole)
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (signer, whole) = &*SIGNED;
    let model = *b"RLG-28\0\0\0\0\0\0\0\0\0\0";
    let trust = Keyed { public_key: signer.public().bytes(), model, lowest_counter: 1, challenge: || [0; 16] };
    // The bytes as they are, and laid over a signed image: at a place, so many.
    let _ = Trusted::check(bytes, &trust);
    if let [high, low, over @ ..] = bytes {
        let mut changed = whole.clone();
        let at = usize::from(u16::from_be_bytes([*high, *low])) % changed.len();
        let end = (at + over.len()).min(changed.len());
        changed[at..end].copy_from_slice(&over[..end - at]);
        assert_eq!(
            Trusted::check(&changed, &trust).is_ok(),
            changed == *whole,
            "another image under the same signature"
        );
    }
    let _ = SignatureBlock::split(bytes);
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = Signer::from_pem(text).map(|signer| signer.public().bytes());
        let _ = PublicKey::from_pem(text).map(|key| key.id());
    }
});
