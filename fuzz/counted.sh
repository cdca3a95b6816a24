#!/bin/sh
# RUSTC_WRAPPER of `cargo xtask fuzz --smoke`: a crate with the feature `counted` counts the code that it reaches, which the
# fuzzer cannot do without. All others are those of the tests.
case "$*" in
  *'feature="counted"'*)
    set -- "$@" -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
      -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table ;;
esac
exec "$@"
