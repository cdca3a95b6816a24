//! A message of the console in HTML: a part in backticks is code.

use maud::{Markup, html};

/// The message. A backtick without its second stays.
pub(crate) fn prose(message: &str) -> Markup {
    let parts: Vec<&str> = message.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return html! { (message) };
    }
    html! { @for (at, part) in parts.iter().enumerate() { @if at % 2 == 1 { code { (part) } } @else { (part) } } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backticks_become_code() {
        assert_eq!(prose("give `--tau 20` & `x`").into_string(), "give <code>--tau 20</code> &amp; <code>x</code>");
        assert_eq!(prose("5` of arc").into_string(), "5` of arc");
    }
}
