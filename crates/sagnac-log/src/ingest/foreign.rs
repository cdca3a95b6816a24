//! Formats of other programs that are recognised by their first bytes and not read, with the command that makes a CSV of them.
//!
//! No crate reads all of what MATLAB, LabVIEW, CAN loggers and ArduPilot write; the programs of Python below do, and are kept by those who
//! know the formats. Each command was tried on a file that the same package wrote.

use crate::error::Error;

/// First bytes, the name of the format, and the command.
const FOREIGN: [(&[u8], &str, &str); 8] = [
    (b"MATLAB 7.3 MAT-file", "MATLAB 7.3", H5PY),
    (
        b"MATLAB 5.0 MAT-file",
        "MATLAB 5",
        "python3 -c \"import scipy.io, pandas; m = scipy.io.loadmat('log.mat', squeeze_me=True); pandas.DataFrame({k: v for k, v in m.items() if getattr(v, 'ndim', 0) == 1}).to_csv('log.csv', index=False)\"",
    ),
    (b"\x89HDF\r\n\x1a\n", "HDF5", H5PY),
    (
        b"TDSm",
        "NI TDMS",
        "python3 -c \"from nptdms import TdmsFile; d = TdmsFile.read('log.tdms').as_dataframe(); d.columns = [c.split(chr(39))[-2] for c in d]; d.to_csv('log.csv', index=False)\"",
    ),
    (
        b"MDF     ",
        "ASAM MDF",
        "python3 -c \"from asammdf import MDF; MDF('log.mf4').to_dataframe().rename_axis('time_s').to_csv('log.csv')\"",
    ),
    (b"\xa3\x95\x80", "ArduPilot DataFlash", "mavlogdump.py --format csv --types IMU log.bin > log.csv"),
    (
        b"PK\x03\x04",
        "a zip archive, such as Excel's",
        "python3 -c \"import pandas; pandas.read_excel('log.xlsx').to_csv('log.csv', index=False)\"",
    ),
    (b"SQLite format 3\0", "SQLite", "sqlite3 -header -csv log.db 'SELECT * FROM log' > log.csv"),
];
const H5PY: &str = "python3 -c \"import h5py, pandas; f = h5py.File('log.h5'); pandas.DataFrame({k: v[()].ravel() for k, v in f.items() if getattr(v, 'size', 0) > 1}).to_csv('log.csv', index=False)\"";

/// The refusal of a file of another program, by its first bytes.
pub(crate) fn refusal(start: &[u8]) -> Option<Error> {
    let (_, name, command) = FOREIGN.iter().find(|(magic, ..)| start.starts_with(magic))?;
    Some(
        Error::input(format!("this is {name}, which is not read here"))
            .help(format!("convert it, with your own names: {command}")),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_programs_are_named_with_their_command() {
        for (magic, name, command) in FOREIGN {
            let error = refusal(&[magic, b" and more"].concat()).unwrap();
            assert!(error.what.contains(name) && error.help.unwrap().ends_with(command), "{name}");
        }
        assert!(refusal(b"time_s,counts\n").is_none() && refusal(b"").is_none());
    }
}
