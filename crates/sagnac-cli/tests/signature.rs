//! Keys, signed images and the service mode, from the command line to a board with a key.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use sagnac_board::{CommandHandler, MemoryFlash, run};
use sagnac_core::{Banks, Gyro, Image, SIGNATURE_LEN};
use sagnac_loops::LoopTable;
use sagnac_signature::{Keyed, PublicKey};

/// Exit status, standard output and standard error.
fn sagnac(args: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("sagnac").unwrap().args(args).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn done(args: &[&str]) -> String {
    let (status, said, complained) = sagnac(args);
    assert_eq!(status, 0, "{args:?}: {complained}");
    said
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn testdata(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata").join(name)
}

struct Folder {
    folder: tempfile::TempDir,
}

impl Folder {
    /// With a key, and the paper's image signed by it.
    fn new() -> Self {
        let it = Self { folder: tempfile::tempdir().unwrap() };
        done(&["key", "new", "-o", text(&it.path("a.key"))]);
        let (key, to) = (it.path("a.key"), it.path("signed.img"));
        let args = ["--model", "RLG-28", "--counter", "12", "-o", text(&to)];
        done(&[&["key", "sign", text(&paper()), "--key", text(&key)], &args[..]].concat());
        it
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

fn paper() -> PathBuf {
    testdata("image/paper.img")
}

#[test]
fn a_signature_is_made_and_checked() {
    let it = Folder::new();
    let (public, signed) = (it.path("a.pub"), it.path("signed.img"));
    let (status, said, _) =
        sagnac(&["key", "verify", text(&signed), "--key", text(&public), "--model", "RLG-28", "--counter", "12"]);
    assert!(status == 0 && said.contains("good: axis") && said.contains("signed for RLG-28, counter 12"), "{said}");
    // The private key serves as a public one; openssl's format is the same.
    assert_eq!(sagnac(&["key", "verify", text(&signed), "--key", text(&it.path("a.key"))]).0, 0);
    for (args, why) in [
        (&["--model", "RLG-29"][..], "another type of gyro"),
        (&["--counter", "13"], "the signer's counter is 12; this gyro trusts 13 or more"),
    ] {
        let (status, said, _) = sagnac(&[&["key", "verify", text(&signed), "--key", text(&public)], args].concat());
        assert!(status == 1 && said.contains("NOT GOOD") && said.contains(why), "{said}");
    }
    done(&["key", "new", "-o", text(&it.path("b.key"))]);
    let (status, said, _) = sagnac(&["key", "verify", text(&signed), "--key", text(&it.path("b.pub"))]);
    assert!(status == 1 && said.contains("signed with another key"), "{said}");
    let (status, said, _) = sagnac(&["key", "verify", text(&paper()), "--key", text(&public)]);
    assert!(status == 1 && said.contains("not signed"), "{said}");
    // A changed byte of the correction under a CRC that fits.
    let mut bytes = fs::read(&signed).unwrap();
    let image = bytes.len() - SIGNATURE_LEN;
    bytes[130] ^= 1;
    let crc = sagnac_core::bytes::crc32(&bytes[..image - 4]);
    bytes[image - 4..image].copy_from_slice(&crc.to_le_bytes());
    let forged = it.path("forged.img");
    fs::write(&forged, bytes).unwrap();
    let (status, said, _) = sagnac(&["key", "verify", text(&forged), "--key", text(&public)]);
    assert!(status == 1 && said.contains("the signature does not match the image"), "{said}");
}

/// The program reads a signed image wherever it reads an image, and keeps its signature when it exports it again.
#[test]
fn a_signed_image_is_an_image() {
    let it = Folder::new();
    let signed = it.path("signed.img");
    let said = done(&["inspect", text(&signed)]);
    assert!(said.contains("signed for RLG-28, counter 12, by key") && said.contains("not checked here"), "{said}");
    let json: serde_json::Value = serde_json::from_str(&done(&["inspect", text(&signed), "--json"])).unwrap();
    assert_eq!(json["signature"]["counter"], 12);
    let again = it.path("again.img");
    done(&["export", text(&signed), "--to", "image", "-o", text(&again)]);
    assert_eq!(fs::read(&again).unwrap(), fs::read(&signed).unwrap());
    let (key, model) = (it.path("a.key"), ["--model", "RLG-28", "--counter", "12"]);
    let direct = it.path("direct.img");
    done(
        &[&["export", text(&paper()), "--to", "image", "--sign", text(&key), "-o", text(&direct)], &model[..]].concat(),
    );
    assert_eq!(fs::read(&direct).unwrap(), fs::read(&signed).unwrap(), "one image has one signature");
    let twice = [&["key", "sign", text(&signed), "--key", text(&key), "-o", text(&again)], &model[..]].concat();
    assert!(sagnac(&twice).2.contains("is signed already"));
}

/// A key is readable by its owner alone, and is never overwritten; what is no key is refused by name.
#[test]
fn keys_are_kept() {
    let it = Folder::new();
    let key = it.path("a.key");
    let before = fs::read(&key).unwrap();
    let (status, _, complained) = sagnac(&["key", "new", "-o", text(&key)]);
    assert!(status == 2 && complained.contains("never overwritten"), "{complained}");
    assert_eq!(fs::read(&key).unwrap(), before);
    fs::remove_file(it.path("a.pub")).unwrap();
    assert_eq!(sagnac(&["key", "new", "-o", text(&key)]).0, 2);
    assert!(!it.path("a.pub").exists(), "no public key without its private one");
    #[cfg(unix)]
    assert_eq!(std::os::unix::fs::MetadataExt::mode(&fs::metadata(&key).unwrap()) & 0o777, 0o600);
    let (image, own) = (paper(), text(&key).to_owned());
    for (words, why) in [
        ("key sign IMAGE --key IMAGE --model A --counter 1 -o x.img", "paper.img"),
        ("key sign IMAGE --key KEY --counter 1 -o x.img", "--model"),
        ("key sign IMAGE --key KEY --model A -o x.img", "--counter"),
        ("key sign IMAGE --key KEY --model a-name-of-17-byte --counter 1 -o x.img", "1 to 16 bytes"),
        ("key sign IMAGE --key KEY --model A --counter 1 -o KEY", "a.key"),
        ("export IMAGE --to c --sign KEY --model A --counter 1 -o x", "--to image"),
        ("export IMAGE --to image --trial -o x", "--to upload"),
        ("export IMAGE --to image --model A -o x", "applies only with --sign"),
        ("export IMAGE --to image --sign KEY --model A -o x", "--counter"),
    ] {
        let args: Vec<&str> = words
            .split(' ')
            .map(|word| match word {
                "IMAGE" => text(&image),
                "KEY" => &own,
                word => word,
            })
            .collect();
        let (status, _, complained) = sagnac(&args);
        assert!(status == 2 && complained.contains(why), "{args:?}: {complained}");
    }
    assert_eq!(fs::read(&key).unwrap(), before);
}

/// Service, challenge, answer, upload on trial, confirmation: every byte made by the program, every reply read by it.
#[test]
fn a_board_with_a_key_is_served_from_the_command_line() {
    let it = Folder::new();
    let (key, line, back) = (it.path("a.key"), it.path("line.bin"), it.path("back.bin"));
    let public = PublicKey::from_pem(&fs::read_to_string(it.path("a.pub")).unwrap()).unwrap().bytes();
    let image = Image::decode(&fs::read(paper()).unwrap()).unwrap();
    let serial = image.serial().unwrap().to_owned();
    let axis = char::from(image.description().axis).to_string();
    let mut words_bytes = [0; sagnac_vectors::MAX_TABLE];
    let vectors = fs::read(testdata("vectors/intensity.hex")).unwrap();
    let mut words = sagnac_vectors::Words::new(&vectors);
    let head = words.head().unwrap();
    let loops = LoopTable::decode(words.table(&head, &mut words_bytes).unwrap()).unwrap();
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).unwrap();
    let model = *b"RLG-28\0\0\0\0\0\0\0\0\0\0";
    let trust = Keyed { public_key: public, model, lowest_counter: 12, challenge: || *b"0123456789abcdef" };
    let mut board = CommandHandler::with_trust(banks, Gyro::of(&image, 4), loops, trust);
    // One power-on: the bytes of several commands in a row. The summary of `sagnac line read` comes back.
    let mut said = |commands: &[&[&str]]| -> String {
        let mut bytes = Vec::new();
        for command in commands {
            done(&[*command, &["-o", text(&line)]].concat());
            bytes.extend(fs::read(&line).unwrap());
        }
        let mut out = Vec::new();
        run(&mut board, bytes.into_iter(), |bytes| out.extend_from_slice(bytes));
        fs::write(&back, out).unwrap();
        sagnac(&["line", "read", text(&back), "-o", text(&it.path("frames.csv"))]).2
    };
    let signed = it.path("signed.img");
    let upload = ["export", text(&signed), "--to", "upload", "--trial"];
    let service = |change: &'static str| ["line", "send", "service", change];
    let hex = "30313233343536373839616263646566";
    let (key, serial, axis) = (text(&key).to_owned(), serial, axis);
    let answer = |change: &'static str| {
        ["line", "send", "answer", change, "--challenge", hex, "--key", &key, "--serial", &serial, "--axis", &axis]
    };
    assert!(said(&[&upload]).contains("commit of an image: refused: the service mode is closed"));
    let opened = said(&[&service("commit"), &answer("commit"), &upload]);
    assert!(opened.contains(&format!("challenge {hex}")) && opened.contains("answer to a challenge: done"), "{opened}");
    assert!(opened.contains("commit of an image: done; image 1 active, on trial: confirm it"), "{opened}");
    assert!(said(&[&["line", "send", "confirm"]]).contains("confirmation: refused: the service mode is closed"));
    let other = said(&[&service("roll-back"), &answer("roll-back"), &["line", "send", "confirm"]]);
    assert!(other.contains("confirmation: refused: the service mode is closed"), "{other}");
    let confirmed = said(&[&service("confirm"), &answer("confirm"), &["line", "send", "confirm"]]);
    assert!(confirmed.contains("confirmation: done; image 1 active\n"), "{confirmed}");
    let unsigned = said(&[&service("commit"), &answer("commit"), &["export", text(&paper()), "--to", "upload"]]);
    assert!(unsigned.contains("refused: not signed, and this gyro has a key"), "{unsigned}");
}
