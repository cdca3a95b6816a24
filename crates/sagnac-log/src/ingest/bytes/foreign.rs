//! Formats of other programs that are recognised by their first bytes and not read, with the command that makes a CSV of them.
//!
//! Such a file holds arrays with clocks of their own, and only its owner knows which of them make a row: docs/how-to/other-tools.md says
//! which crates there are, and why they are not used. The packages of Python below are kept by those who know the formats. `cargo xtask formats` runs each command, as the program prints it, on a file that the same package wrote.

use std::path::Path;

use crate::error::Error;

/// First bytes, the name of the format, what else to name in the command, and the command from `IN` to `OUT`. None of them resamples or
/// interpolates: a count that nobody counted would be worse than a command that stops.
const FOREIGN: [(&[u8], &str, &str, &str); 8] = [
    (b"MATLAB 7.3 MAT-file", "MATLAB 7.3", "", H5PY),
    (
        b"MATLAB 5.0 MAT-file",
        "MATLAB 5",
        "",
        "python3 -c \"import scipy.io, pandas; v = {k: v for k, v in scipy.io.loadmat('IN', squeeze_me=True).items() if getattr(v, 'ndim', 0) == 1}; n = max(map(len, v.values())); pandas.DataFrame({k: x for k, x in v.items() if len(x) == n}).to_csv('OUT', index=False)\"",
    ),
    (b"\x89HDF\r\n\x1a\n", "HDF5", "", H5PY),
    (
        b"TDSm",
        "NI TDMS",
        "",
        "python3 -c \"from nptdms import TdmsFile; import pandas; c = [c for g in TdmsFile.read('IN').groups() for c in g.channels()]; pandas.DataFrame(dict(enumerate(v[:] for v in c))).set_axis([v.name for v in c], axis=1).to_csv('OUT', index=False)\"",
    ),
    (
        b"MDF     ",
        "ASAM MDF",
        "the gyro's channel for 'counts'",
        // The rows are those of the gyro; a reading of another group is put into the first row at or after it.
        "python3 -c \"from functools import reduce; from asammdf import MDF; import pandas; m = MDF('IN'); t = pandas.DataFrame({'time_s': m.get('counts').timestamps}); reduce(lambda a, b: pandas.merge_asof(a, b.rename_axis('time_s').reset_index().drop_duplicates('time_s'), on='time_s', tolerance=0.99 * float(t.time_s.diff().median())), m.iter_groups(time_from_zero=False), t).to_csv('OUT', index=False)\"",
    ),
    (
        b"\xa3\x95\x80",
        "ArduPilot DataFlash",
        "",
        "python3 -c \"from pymavlink import mavutil; import pandas; f = mavutil.mavlink_connection('IN'); r = [(m.TimeUS, m.T, m.GyrX, m.GyrY, m.GyrZ) for m in iter(lambda: f.recv_match(type='IMU'), None) if m.I == 0]; pandas.DataFrame(r, columns=['time_us', 'temperature_c', 'rate_radps_x', 'rate_radps_y', 'rate_radps_z']).to_csv('OUT', index=False)\"",
    ),
    (
        b"PK\x03\x04",
        "a zip archive, such as Excel's",
        "",
        "python3 -c \"import pandas; pandas.read_excel('IN').to_csv('OUT', index=False)\"",
    ),
    (
        b"SQLite format 3\0",
        "SQLite",
        "your table for log",
        "python3 -c \"import sqlite3, pandas; pandas.read_sql('SELECT * FROM log', sqlite3.connect('IN')).to_csv('OUT', index=False)\"",
    ),
];
const H5PY: &str = "python3 -c \"import h5py, pandas; v = {k: v[()].ravel() for k, v in h5py.File('IN').items() if getattr(v, 'size', 0) and v.size > 1}; n = max(map(len, v.values())); pandas.DataFrame({k: x for k, x in v.items() if len(x) == n}).to_csv('OUT', index=False)\"";

/// The refusal of a file of another program, by its first bytes; the command has the file's name where a shell can take it as it is.
pub(crate) fn refusal(start: &[u8], file: Option<&Path>) -> Option<Error> {
    let (_, name, own, command) = FOREIGN.iter().find(|(magic, ..)| start.starts_with(magic))?;
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+".contains(c);
    let file = file.and_then(Path::to_str).filter(|file| file.chars().all(is_plain));
    let own_file = if file.is_none() { "your file for 'log'" } else { "" };
    let own: Vec<&str> = [own_file, own].into_iter().filter(|own| !own.is_empty()).collect();
    let with = if own.is_empty() { String::new() } else { format!(", with {}", own.join(" and ")) };
    let file = file.unwrap_or("log");
    let command = with_names(command, file, &format!("{file}.csv"));
    Some(Error::input(
        format!("this is {name}, and the program cannot read it"),
        format!("convert it{with}: {command}"),
    ))
}

/// The command with its two names.
fn with_names(command: &str, from: &str, to: &str) -> String {
    command.replace("'OUT'", &format!("'{to}'")).replace("'IN'", &format!("'{from}'"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_programs_are_named_with_their_command() {
        for (magic, name, own, command) in FOREIGN {
            let start = [magic, b" and more"].concat();
            let error = refusal(&start, Some(Path::new("runs/a-1.mat"))).unwrap();
            let help = error.help;
            assert!(error.what.contains(name), "{name}");
            assert_eq!(help.matches("'runs/a-1.mat").count(), 2, "{help}");
            assert_eq!(help.matches("'runs/a-1.mat.csv'").count(), 1, "{help}");
            assert!(own.is_empty() || help.starts_with(&format!("convert it, with {own}: ")), "{help}");
            assert!(!command.contains('$') && command.matches('"').count() == 2, "{command}");
        }
        assert!(refusal(b"time_s,counts\n", None).is_none() && refusal(b"", None).is_none());
    }

    #[test]
    fn a_name_that_a_shell_would_change_is_left_to_the_user() {
        for file in [None, Some("my log.mat"), Some("$(reboot).mat"), Some("o'clock.mat"), Some("C:\\log.mat")] {
            let help = refusal(b"TDSm", file.map(Path::new)).unwrap().help;
            assert!(help.starts_with("convert it, with your file for 'log': ") && help.contains("'log.csv'"), "{help}");
        }
    }
}
