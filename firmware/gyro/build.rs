//! Puts the memory map where the linker looks, and the three files of the unit where the code includes them.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    fs::copy("memory.x", out.join("memory.x")).expect("memory.x");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed=memory.x");
    let key = env::var_os("CARGO_FEATURE_SIGNED").map(|_| ("SAGNAC_KEY", "unit.key"));
    for (variable, name) in [("SAGNAC_IMAGE", "unit.img"), ("SAGNAC_LOOPS", "unit.loops")].into_iter().chain(key) {
        println!("cargo:rerun-if-env-changed={variable}");
        let path =
            env::var_os(variable).unwrap_or_else(|| panic!("{variable} names no file: use cargo xtask firmware"));
        println!("cargo:rerun-if-changed={}", PathBuf::from(&path).display());
        fs::copy(&path, out.join(name)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    }
}
