//! Rows of a Parquet file in a program that was built without it: refused before the first.

use std::convert::Infallible;
use std::io::Write;
use std::marker::PhantomData;

use crate::error::{Error, Result};
use crate::ingest::Content;

/// Never made.
pub struct ParquetRows<'a>(Infallible, PhantomData<&'a ()>);

impl<'a> ParquetRows<'a> {
    /// As with Parquet.
    ///
    /// # Errors
    /// Always.
    pub fn new(
        _: &'a mut (dyn Write + Send),
        _: Vec<(String, Content)>,
        _: Option<(String, String)>,
        _: bool,
    ) -> Result<Self> {
        Err(Error::without("Parquet"))
    }

    /// As with Parquet.
    ///
    /// # Errors
    /// None: there is no such value.
    pub fn row<C: AsRef<[u8]>>(&mut self, _: &[C]) -> Result<()> {
        match self.0 {}
    }

    /// As with Parquet.
    ///
    /// # Errors
    /// None: there is no such value.
    pub fn finish(&mut self) -> Result<()> {
        match self.0 {}
    }
}
