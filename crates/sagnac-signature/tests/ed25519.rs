//! The arithmetic against RFC 8032 and openssl, and the forms of a signature that are refused.

use sagnac_core::{SIGNATURE_LEN, SignatureBlock, key_id};
use sagnac_signature::{KeyError, PublicKey, Signer, verify};

fn bytes<const N: usize>(hex: &str) -> [u8; N] {
    let all: Vec<u8> = (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect();
    all.try_into().unwrap()
}

/// RFC 8032 §7.1, TEST 1 and TEST 2: seed, public key, message, signature.
const RFC_8032: [[&str; 4]; 2] = [
    [
        "9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60",
        "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a",
        "",
        "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc61e39701cf9b46bd25bf5f0595bbe24655141438e7a100b",
    ],
    [
        "4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb",
        "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
        "72",
        "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
    ],
];

#[test]
fn the_vectors_of_the_standard_hold() {
    for [seed, public, message, signature] in RFC_8032 {
        let key = Signer::from_seed(&bytes(seed)).public();
        assert_eq!(key.bytes(), bytes::<32>(public));
        let message: Vec<u8> = if message.is_empty() { Vec::new() } else { bytes::<1>(message).to_vec() };
        assert!(verify(&bytes(public), &message, &bytes(signature)));
    }
}

/// A second form of a signature (S + L instead of S) and a key of small order, under which anything verifies: both refused.
#[test]
fn what_is_not_canonical_is_refused() {
    /// The order of the group, RFC 8032 §5.1.
    const ORDER: &str = "edd3f55c1a631258d69cf7a2def9de1400000000000000000000000000000010";
    let [_, public, _, signature] = RFC_8032[1];
    let (public, mut second) = (bytes::<32>(public), bytes::<64>(signature));
    let mut carry = 0_u16;
    for (byte, more) in second[32..].iter_mut().zip(bytes::<32>(ORDER)) {
        carry += u16::from(*byte) + u16::from(more);
        *byte = carry as u8;
        carry >>= 8;
    }
    assert!(verify(&public, &[0x72], &bytes(signature)) && !verify(&public, &[0x72], &second));
    // The neutral element as key and as R, S = 0: the equation holds for every message.
    let mut neutral = [0; 32];
    neutral[0] = 1;
    let mut for_all = [0; 64];
    for_all[0] = 1;
    assert!(!verify(&neutral, b"any", &for_all));
}

/// A key and a signature that openssl 3.0 made (`genpkey -algorithm ed25519`, `pkeyutl -sign -rawin`).
#[test]
fn the_keys_of_openssl_are_read() {
    let private = "-----BEGIN PRIVATE KEY-----\nMC4CAQAwBQYDK2VwBCIEIH/UNFek4U8Nm8Y8UzoMnLnaRhSQbNRqsISTi25vgKrd\n-----END PRIVATE KEY-----\n";
    let public = "-----BEGIN PUBLIC KEY-----\nMCowBQYDK2VwAyEAHaMlOCw8AKsC83KJFNbPD4JFUbd4/waOB5Af/fpvXJc=\n-----END PUBLIC KEY-----\n";
    let signature = "3d05a4f4e2a25cbad4e435452ee31d1585b1a272feab3c12d367debb21741bb104b5af934de9b75268aff5cb1f7ab3ad5c6ce2ab6bb71adbc72f495ee1eb5c0a";
    let (signer, key) = (Signer::from_pem(private).unwrap(), PublicKey::from_pem(public).unwrap());
    assert_eq!(signer.public(), key);
    assert_eq!(key.to_pem().unwrap(), public);
    assert!(verify(&key.bytes(), b"a signed line", &bytes(signature)));
    assert_eq!(Signer::from_pem(&signer.to_pem().unwrap()).unwrap().public(), key);
    assert_eq!(PublicKey::from_pem(private), Err(KeyError::NotAPublicKey));
    assert_eq!(Signer::from_pem(public).err(), Some(KeyError::NotAPrivateKey));
}

#[test]
fn a_new_key_is_a_new_key() {
    let [one, other] = [0, 1].map(|_| Signer::generate().unwrap());
    assert_ne!(one.public(), other.public());
    let block = one.sign(b"an image", *b"RLG-28\0\0\0\0\0\0\0\0\0\0", 7).unwrap();
    let message = block.message(b"an image").unwrap();
    assert!(verify(&one.public().bytes(), message.bytes(), &block.signature));
    assert!(!verify(&other.public().bytes(), message.bytes(), &block.signature));
    assert_eq!(block.key_id, key_id(&one.public().bytes()));
    let encoded = block.encode();
    assert_eq!(encoded.len(), SIGNATURE_LEN);
    assert_eq!(SignatureBlock::split(&encoded), Ok((&[][..], Some(block))));
    assert!(one.sign(&[0; 773], [0; 16], 1).is_none(), "longer than any image");
}
