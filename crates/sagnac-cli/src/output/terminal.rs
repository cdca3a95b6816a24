//! What fits the terminal: lines wrapped by word, tables as wide as there is room.
//!
//! A file or a pipe gets every line whole, so that what a script reads does not depend on a window's size. A table that is too wide has its
//! words wrapped; where not even its longest words fit, each row is a block of lines, so that no number is ever broken.

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, LineStyle, Table, Width, presets};
use terminal_size::terminal_size_of;
use textwrap::core::display_width;
use textwrap::{Options, WordSeparator, WordSplitter};

/// Columns of a short result.
pub(crate) const MOST_COLUMNS: usize = 100;

/// How good a verdict is, for its colour.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tone {
    Good,
    Bad,
    Open,
    Plain,
}

/// Columns below which nothing is laid out.
const LEAST_COLUMNS: usize = 20;
/// A space at which no line is broken.
const NO_BREAK: char = '\u{a0}';
/// Blank columns of a cell, left and right of it.
const PADDING: (u16, u16) = (1, 1);
/// The blank column between two cells.
const GAP: usize = 1;

/// Columns of the terminal on standard output; `None` where that is no terminal.
pub(crate) fn columns_of_output() -> Option<usize> {
    columns_of(terminal_size_of(std::io::stdout()))
}

/// Columns of the terminal on standard error; `None` where that is no terminal.
pub(crate) fn columns_of_errors() -> Option<usize> {
    columns_of(terminal_size_of(std::io::stderr()))
}

fn columns_of(size: Option<(terminal_size::Width, terminal_size::Height)>) -> Option<usize> {
    // Some terminals say 0 while they do not know.
    size.map(|(width, _)| usize::from(width.0)).filter(|columns| *columns >= LEAST_COLUMNS)
}

/// True where the locale of the terminal is one of UTF-8, or says nothing.
pub(crate) fn is_utf8() -> bool {
    let named = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().filter_map(std::env::var_os).find(|value| !value.is_empty());
    named.is_none_or(|name| {
        let name = name.to_string_lossy().to_ascii_lowercase();
        name.contains("utf-8") || name.contains("utf8")
    })
}

/// The same text in ASCII, for a terminal without UTF-8.
pub(crate) fn ascii(text: &str) -> String {
    let plain = |c: char| match c {
        '°' => "deg".to_owned(),
        '±' => "+-".to_owned(),
        '−' | '–' | '─' | '‐' => "-".to_owned(),
        '…' => "...".to_owned(),
        '≤' => "<=".to_owned(),
        '≥' => ">=".to_owned(),
        'σ' => "sigma".to_owned(),
        'τ' => "tau".to_owned(),
        'Ω' => "Omega".to_owned(),
        'Ṫ' => "dT/dt".to_owned(),
        'Δ' => "D".to_owned(),
        'χ' => "chi".to_owned(),
        '√' => "rt ".to_owned(),
        '²' => "^2".to_owned(),
        '·' | '×' => "*".to_owned(),
        'µ' | 'μ' => "u".to_owned(),
        '\u{a0}' => " ".to_owned(),
        c if c.is_ascii() => c.to_string(),
        _ => "?".to_owned(),
    };
    text.chars().map(plain).collect()
}

/// Lines no longer than `columns`, broken between words; what continues a line is indented by two more. A word that is longer stays whole.
pub(crate) fn wrapped(text: &str, columns: Option<usize>) -> String {
    let Some(columns) = columns else { return text.to_owned() };
    let lines = text.split('\n').map(|line| {
        if display_width(line) <= columns {
            return line.to_owned();
        }
        let start = line.len() - line.trim_start_matches(' ').len();
        let deeper = " ".repeat(start + 2);
        let options = Options::new(columns)
            .break_words(false)
            .word_separator(WordSeparator::AsciiSpace)
            .word_splitter(WordSplitter::NoHyphenation)
            .wrap_algorithm(textwrap::WrapAlgorithm::FirstFit)
            .initial_indent(&line[..start])
            .subsequent_indent(&deeper);
        textwrap::fill(&line[start..], options)
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Rows as lines with aligned columns, two blanks apart; the first row may be titles.
pub(crate) fn lines_of(rows: &[Vec<String>]) -> Vec<String> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width =
        |at: usize| rows.iter().filter_map(|row| row.get(at)).map(|cell| display_width(cell)).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let padded =
            row.iter().zip(&widths).map(|(cell, width)| format!("{cell}{}", " ".repeat(width - display_width(cell))));
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

/// A plain aligned table that fits the terminal; the first column to the left, numbers to the right. A column without any value is not
/// shown.
pub(crate) fn table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let (header, rows) = with_values(header, rows.into_iter().collect());
    table_within(columns_of_output(), &header, &rows)
}

/// The columns that have a value in some row; the first stays.
fn with_values<'a>(header: &[&'a str], rows: Vec<Vec<String>>) -> (Vec<&'a str>, Vec<Vec<String>>) {
    let has_value =
        |at: usize| rows.iter().any(|row| row.get(at).is_some_and(|cell| !["", "-"].contains(&cell.as_str())));
    let kept: Vec<bool> = (0..header.len()).map(|at| at == 0 || rows.is_empty() || has_value(at)).collect();
    let is_kept = |at: usize| kept.get(at).copied().unwrap_or(true);
    let header = header.iter().enumerate().filter(|(at, _)| is_kept(*at)).map(|(_, title)| *title).collect();
    let of_row =
        |row: Vec<String>| row.into_iter().enumerate().filter(|(at, _)| is_kept(*at)).map(|(_, cell)| cell).collect();
    let rows = rows.into_iter().map(of_row).collect();
    (header, rows)
}

fn table_within(columns: Option<usize>, header: &[&str], rows: &[Vec<String>]) -> String {
    let natural = laid_out(header, rows).trim_fmt();
    let Some(columns) = columns.filter(|columns| width_of(&natural) > *columns) else { return natural };
    let wide = || fitted(columns, header, rows, kept_together, PADDING);
    let narrow = || fitted(columns, header, rows, str::to_owned, (0, 0));
    wide().or_else(narrow).unwrap_or_else(|| blocks(header, rows, columns))
}

/// The table within the terminal, with lines broken in its cells; `None` where its longest words do not fit.
fn fitted(
    columns: usize,
    header: &[&str],
    rows: &[Vec<String>],
    kept: fn(&str) -> String,
    padding: (u16, u16),
) -> Option<String> {
    let rows: Vec<Vec<String>> = rows.iter().map(|row| row.iter().map(|cell| kept(cell)).collect()).collect();
    let blank = padding.0 + padding.1;
    let widths = widths_within(columns, usize::from(blank) + GAP, &texts_of_columns(header, &rows))?;
    let mut table = laid_out(header, &rows);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(u16::try_from(columns).unwrap_or(u16::MAX));
    for (column, width) in table.column_iter_mut().zip(widths) {
        let width = u16::try_from(width).unwrap_or(u16::MAX).saturating_add(blank);
        column.set_padding(padding).set_constraint(ColumnConstraint::Absolute(Width::Fixed(width)));
    }
    let text = table.trim_fmt().replace(NO_BREAK, " ");
    (width_of(&text) <= columns).then_some(text)
}

/// A cell whose values stay next to their uncertainties, percent signs and names.
fn kept_together(cell: &str) -> String {
    let cell = cell.replace(" ± ", "\u{a0}±\u{a0}").replace(" %", "\u{a0}%");
    let mut before = ' ';
    let mut out = String::with_capacity(cell.len());
    let mut rest = cell.chars().peekable();
    while let Some(c) = rest.next() {
        let is_order = c == ' ' && before.is_alphabetic() && rest.peek().is_some_and(char::is_ascii_digit);
        out.push(if is_order { NO_BREAK } else { c });
        before = c;
    }
    out
}

/// The title and cells of each column.
fn texts_of_columns(header: &[&str], rows: &[Vec<String>]) -> Vec<Vec<String>> {
    let columns = rows.iter().map(Vec::len).chain([header.len()]).max().unwrap_or(0);
    let column = |at: usize| {
        let title = header.get(at).map(|title| (*title).to_owned());
        title.into_iter().chain(rows.iter().filter_map(|row| row.get(at).cloned())).collect()
    };
    (0..columns).map(column).collect()
}

/// Widths of the columns within the terminal: each starts with its longest word, and the column with the most broken lines gets more.
/// Squares, so that one long cell counts for more than a break in each of many.
fn widths_within(columns: usize, blank: usize, texts: &[Vec<String>]) -> Option<Vec<usize>> {
    let longest =
        |cells: &Vec<String>| cells.iter().flat_map(|cell| cell.split(' ')).map(display_width).max().unwrap_or(0);
    let mut widths: Vec<usize> = texts.iter().map(longest).collect();
    let spare = columns.checked_sub((widths.iter().map(|width| width + blank).sum::<usize>()).saturating_sub(GAP))?;
    let broken = |at: usize, width: usize| -> usize {
        let options = Options::new(width.max(1)).break_words(false).word_separator(WordSeparator::AsciiSpace);
        texts[at].iter().map(|cell| textwrap::wrap(cell, &options).len().saturating_sub(1).pow(2)).sum()
    };
    let mut lines: Vec<usize> = widths.iter().enumerate().map(|(at, width)| broken(at, *width)).collect();
    for _ in 0..spare {
        let Some((at, most)) = lines.iter().copied().enumerate().max_by_key(|(at, lines)| (*lines, usize::MAX - at))
        else {
            break;
        };
        if most == 0 {
            break;
        }
        widths[at] += 1;
        lines[at] = broken(at, widths[at]);
    }
    Some(widths)
}

fn laid_out(header: &[&str], rows: &[Vec<String>]) -> Table {
    let mut table = Table::new();
    let rule = LineStyle::none().fill('─').junction('─');
    table.load_style(presets::NOTHING.header_separator(rule)).set_header(header.to_vec());
    for row in rows {
        table.add_row(row.clone());
    }
    for (at, column) in table.column_iter_mut().enumerate().skip(1) {
        // A column without a title is one of remarks.
        let is_numbers = header.get(at).is_none_or(|title| !title.is_empty());
        column.set_cell_alignment(if is_numbers { CellAlignment::Right } else { CellAlignment::Left });
    }
    table
}

fn width_of(text: &str) -> usize {
    text.lines().map(display_width).max().unwrap_or(0)
}

/// A block of lines for each row: its first cell, and below it each other title with its cell.
fn blocks(header: &[&str], rows: &[Vec<String>], columns: usize) -> String {
    let first = header.first().copied().unwrap_or_default();
    let mut lines = Vec::new();
    for row in rows {
        let name = row.first().map_or("", String::as_str);
        let words = [first, name].iter().filter(|word| !word.is_empty()).copied().collect::<Vec<_>>().join(": ");
        lines.push(wrapped(&format!(" {words}"), Some(columns)));
        for (at, cell) in row.iter().enumerate().skip(1).filter(|(_, cell)| !cell.is_empty()) {
            let title = header.get(at).copied().unwrap_or_default();
            let line = if title.is_empty() { format!("   {cell}") } else { format!("   {title}: {cell}") };
            lines.push(wrapped(&line, Some(columns)));
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> (Vec<&'static str>, Vec<Vec<String>>) {
        let header = vec!["limit", "value", "bound", "margin", ""];
        let row = |cells: [&str; 5]| cells.map(str::to_owned).to_vec();
        let rows = vec![
            row(["plateau bias, largest", "0.0123 ± 0.0004", "0.02", "38 %", "met"]),
            row(["scale factor repeatability", "1234567.5 ± 0.3", "5", "-", "NOT MET: two runs of four have no rate"]),
        ];
        (header, rows)
    }

    /// Every word of a table is in it once at each width, whole, and no line is longer than the terminal.
    #[test]
    fn a_table_fits_every_width_and_breaks_no_word() {
        let (header, rows) = example();
        let words = |text: &str| -> Vec<String> {
            let separate = |c: char| c.is_whitespace() || c == '─';
            let mut all: Vec<String> = text.split(separate).filter(|w| !w.is_empty()).map(str::to_owned).collect();
            all.sort();
            all
        };
        let whole = table_within(None, &header, &rows);
        for columns in 44..=200 {
            let text = table_within(Some(columns), &header, &rows);
            assert!(width_of(&text) <= columns, "{columns}:\n{text}");
            if text.contains('─') {
                assert_eq!(words(&text), words(&whole), "{columns}:\n{text}");
            }
        }
        for columns in 24..=44 {
            let text = table_within(Some(columns), &header, &rows);
            assert!(width_of(&text) <= columns, "{columns}:\n{text}");
            for cell in rows.iter().flatten() {
                assert!(cell.split(' ').all(|word| text.contains(word)), "{columns}: {cell}\n{text}");
            }
        }
    }

    #[test]
    fn a_column_without_a_value_is_not_shown() {
        let row = |cells: [&str; 4]| cells.map(str::to_owned).to_vec();
        let rows = vec![row(["x", "-", "1", ""]), row(["y", "", "-", ""])];
        let (header, rows) = with_values(&["axis", "none", "some", ""], rows);
        assert_eq!(header, ["axis", "some"]);
        assert_eq!(rows, [["x", "1"], ["y", "-"]]);
        assert_eq!(with_values(&["a", "b"], Vec::new()).0, ["a", "b"]);
    }

    #[test]
    fn a_file_gets_every_line_whole() {
        let line = "  to improve the curve, soak one more hour at 20 °C: σ of the curve 0.01 → 0.009 °/h";
        assert_eq!(wrapped(line, None), line);
        let narrow = wrapped(line, Some(40));
        assert!(narrow.lines().count() == 3 && narrow.lines().all(|l| display_width(l) <= 40));
        assert!(narrow.starts_with("  to improve") && narrow.lines().skip(1).all(|l| l.starts_with("    ")));
        assert_eq!(narrow.split_whitespace().collect::<Vec<_>>(), line.split_whitespace().collect::<Vec<_>>());
        // A path stays whole, for copying.
        let path = "/a/long/path/of/thirty/characters.csv";
        assert!(wrapped(&format!("wrote {path}"), Some(30)).contains(path));
    }
}
