//! Formats of other programs that are recognised by their first bytes and not read, with the command that makes a CSV of them.
//!
//! Such a file holds arrays with clocks of their own, and only its owner knows which of them make a row: docs/how-to/other-tools.md says
//! which crates there are, and why they are not used. The packages of Python below are kept by those who know the formats. `cargo xtask formats` runs each command, as the program prints it, on a file that the same package wrote.

use std::path::Path;

use crate::error::Error;

/// First bytes, the name of the format, what else to name in the command, and the command from `IN` to `OUT`. None of them resamples or
/// interpolates: a count that nobody counted would be worse than a command that stops.
const FOREIGN: [(&[u8], &str, &str, &str); 9] = [
    (b"MATLAB 7.3 MAT-file", "MATLAB 7.3", "", H5PY),
    (
        b"MATLAB 5.0 MAT-file",
        "MATLAB 5",
        "",
        "python3 -c \"import scipy.io, pandas; v = {k: x for k, x in scipy.io.loadmat('IN', squeeze_me=True).items() if getattr(x, 'size', 0) > 1}; c = COLUMNS; n = max(map(len, c.values())); pandas.DataFrame({k: x for k, x in c.items() if len(x) == n}).to_csv('OUT', index=False)\"",
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
    (b"LabVIEW Measurement", "LabVIEW's LVM", "", "awk \"/^X_Value/{p=1; sub(/X_Value/, t)} p\" t=time_s 'IN' > 'OUT'"),
    (
        b"SQLite format 3\0",
        "SQLite",
        "your table for log",
        "python3 -c \"import sqlite3, pandas; pandas.read_sql('SELECT * FROM log', sqlite3.connect('IN')).to_csv('OUT', index=False)\"",
    ),
];
const H5PY: &str = "python3 -c \"import h5py, pandas; v = {k: x[()].squeeze() for k, x in h5py.File('IN').items() if getattr(x, 'size', 0) and x.size > 1}; c = COLUMNS; n = max(map(len, c.values())); pandas.DataFrame({k: x for k, x in c.items() if len(x) == n}).to_csv('OUT', index=False)\"";
/// The columns of arrays by name: a list is one, and a matrix one for each line along its longer side.
const COLUMNS: &str = "{k if a.ndim == 1 else f'{k}_{i + 1}': x for k, a in v.items() if a.ndim in (1, 2) for i, x in enumerate([a] if a.ndim == 1 else a if a.shape[0] <= a.shape[1] else a.T)}";
/// What a serial monitor puts between its stamp and a line.
const STAMP: &str = " -> ";

/// The refusal of a file of another program, by its first bytes; the command has the file's name where a shell can take it as it is.
pub(crate) fn refusal(start: &[u8], file: Option<&Path>) -> Option<Error> {
    let known = FOREIGN.iter().find(|(magic, ..)| start.starts_with(magic));
    let known = known.map(|(_, name, own, command)| (*name, *own, (*command).to_owned()));
    let (name, own, command) = known.or_else(|| of_serial_monitor(start))?;
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+".contains(c);
    let file = file.and_then(Path::to_str).filter(|file| file.chars().all(is_plain));
    let own_file = if file.is_none() { "your file for 'log'" } else { "" };
    let own: Vec<&str> = [own_file, own].into_iter().filter(|own| !own.is_empty()).collect();
    let with = if own.is_empty() { String::new() } else { format!(", with {}", own.join(" and ")) };
    let file = file.unwrap_or("log");
    let command = with_names(&command, file, &format!("{file}.csv"));
    Some(Error::input(
        format!("this is {name}, and the program cannot read it"),
        format!("convert it{with}: {command}"),
    ))
}

/// The text of a serial monitor, `12:00:00.000 -> 24.50,0.001`: its command makes seconds of the stamps, past midnight too.
fn of_serial_monitor(start: &[u8]) -> Option<(&'static str, &'static str, String)> {
    let first = std::str::from_utf8(start.split(|byte| *byte == b'\n').next()?).ok()?;
    let (stamp, line) = first.split_once(STAMP)?;
    let is_stamp =
        stamp.split(':').count() == 3 && stamp.bytes().all(|byte| byte.is_ascii_digit() || b":.".contains(&byte));
    let cells = line.trim().split(',');
    let has_numbers = cells.clone().all(|cell| cell.trim().parse::<f64>().is_ok());
    let names = (1..=cells.count()).map(|at| format!("column_{at}")).collect::<Vec<_>>().join(",");
    let (head, own) = if has_numbers {
        (format!("BEGIN{{print \"time_s,{names}\"}} "), "your names for column_1 and so on")
    } else {
        ("NR==1{print \"time_s,\" $2; next} ".to_owned(), "")
    };
    let rows =
        "{split($1,c,\":\"); t=c[1]*3600+c[2]*60+c[3]; if(t<p-43200) d+=86400; p=t; printf \"%.3f,%s\\n\",t+d,$2}";
    let command = format!("awk -F '{STAMP}' '{head}{rows}' 'IN' > 'OUT'");
    is_stamp.then_some(("the text of a serial monitor with its stamps", own, command))
}

/// The command with its two names.
fn with_names(command: &str, from: &str, to: &str) -> String {
    command.replace("COLUMNS", COLUMNS).replace("'OUT'", &format!("'{to}'")).replace("'IN'", &format!("'{from}'"))
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
    fn stamps_of_a_serial_monitor_become_seconds() {
        let help = |text: &str| refusal(text.as_bytes(), Some(Path::new("a.txt"))).map(|error| error.help);
        let plain = help("12:00:00.000 -> 24.50,0.00028\n12:00:00.100 -> 24.50,-0.00120\n").unwrap();
        assert!(plain.contains("time_s,column_1,column_2") && plain.contains("'a.txt' > 'a.txt.csv'"), "{plain}");
        let named = help("08:15:00.020 -> temp,gyro_x\r\n").unwrap();
        assert!(named.contains("NR==1") && !named.contains("column_1"), "{named}");
        for other in ["a -> b\n", "time_s,counts\n", "12:00:00 -> ", "12:00 -> 1\n"] {
            assert_eq!(help(other).is_some(), other.starts_with("12:00:00"), "{other}");
        }
    }

    #[test]
    fn a_name_that_a_shell_would_change_is_left_to_the_user() {
        for file in [None, Some("my log.mat"), Some("$(reboot).mat"), Some("o'clock.mat"), Some("C:\\log.mat")] {
            let help = refusal(b"TDSm", file.map(Path::new)).unwrap().help;
            assert!(help.starts_with("convert it, with your file for 'log': ") && help.contains("'log.csv'"), "{help}");
        }
    }
}
