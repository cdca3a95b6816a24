//! Tags and attributes of a page, as far as a link check needs them.

/// One opening tag.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Tag<'a> {
    /// Name of the element, in lower case.
    pub(crate) name: String,
    /// Attributes in their order, names in lower case, references in values resolved.
    pub(crate) attributes: Vec<(String, String)>,
    /// Text behind the tag up to the next one: the content of a `<style>`.
    pub(crate) text: &'a str,
}

impl Tag<'_> {
    /// An attribute's value.
    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

/// All opening tags of a page, except in comments and scripts.
pub(crate) fn tags(page: &str) -> Vec<Tag<'_>> {
    let mut found = Vec::new();
    let mut rest = page;
    while let Some(at) = rest.find('<') {
        rest = &rest[at..];
        if let Some(comment) = rest.strip_prefix("<!--") {
            rest = comment.split_once("-->").map_or("", |(_, after)| after);
            continue;
        }
        let Some((tag, after)) = opening(rest) else {
            rest = &rest[1..];
            continue;
        };
        rest = after;
        let name = tag.name.clone();
        found.push(tag);
        if name == "script" {
            rest = rest.find("</script").map_or("", |end| &rest[end..]);
        }
    }
    found
}

/// The opening tag at the start of the text, and what comes after it.
fn opening(text: &str) -> Option<(Tag<'_>, &str)> {
    let inner = text.strip_prefix('<')?;
    if !inner.starts_with(|c: char| c.is_ascii_alphabetic()) {
        return None;
    }
    let end = inner.find(|c: char| c.is_whitespace() || c == '>' || c == '/')?;
    let name = inner[..end].to_ascii_lowercase();
    let (attributes, after) = attributes(&inner[end..])?;
    let text = &after[..after.find('<').unwrap_or(after.len())];
    Some((Tag { name, attributes, text }, after))
}

/// Attributes up to the tag's end, and what comes after it.
fn attributes(mut text: &str) -> Option<(Vec<(String, String)>, &str)> {
    let mut found = Vec::new();
    loop {
        text = text.trim_start_matches(|c: char| c.is_whitespace() || c == '/');
        if let Some(after) = text.strip_prefix('>') {
            return Some((found, after));
        }
        let end = text.find(|c: char| c.is_whitespace() || matches!(c, '=' | '>' | '/'))?;
        let name = text[..end].to_ascii_lowercase();
        text = text[end..].trim_start();
        let Some(value) = text.strip_prefix('=') else {
            found.push((name, String::new()));
            continue;
        };
        let value = value.trim_start();
        let (value, after) = match value.chars().next()? {
            quote @ ('"' | '\'') => value[1..].split_once(quote)?,
            _ => value.split_at(value.find(|c: char| c.is_whitespace() || c == '>')?),
        };
        found.push((name, resolve(value)));
        text = after;
    }
}

/// Resolves the references that occur in addresses.
fn resolve(value: &str) -> String {
    value.replace("&quot;", "\"").replace("&#39;", "'").replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_of_every_form_are_read() {
        let found = tags("<p>a < b</p><A HREF='x.html?a=1&amp;b' id = \"y\" hidden><img src=p.png/></a>");
        assert_eq!(found.len(), 3, "{found:?}");
        assert_eq!(
            (found[1].get("href"), found[1].get("id"), found[1].get("hidden")),
            (Some("x.html?a=1&b"), Some("y"), Some(""))
        );
        assert_eq!(found[2].get("src"), Some("p.png/"));
    }

    #[test]
    fn comments_and_scripts_hold_no_tags() {
        let found = tags("<!-- <a href=x> --><script src=a.js>if (a<b) { '<a href=\"z\">' }</script><i id=q></i>");
        assert_eq!(found.iter().map(|tag| tag.name.as_str()).collect::<Vec<_>>(), ["script", "i"]);
    }

    #[test]
    fn a_style_keeps_its_text() {
        assert_eq!(tags("<style>a{color:red}</style>")[0].text, "a{color:red}");
    }
}
