//! mdBook's protocol: `[context, book]` as JSON on standard input, the book on standard output.

use std::path::Path;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::equations;

/// The book of mdBook's input with every chapter's text replaced.
pub(crate) fn preprocess(input: &str) -> Result<String> {
    let mut input: Value = serde_json::from_str(input).context("mdBook's input is not JSON")?;
    let source = source_folder(&input)?;
    let items = input.pointer_mut("/1/items").and_then(Value::as_array_mut);
    for item in items.context("mdBook's input has no book.items; mdBook 0.5 is needed")? {
        chapter(item, Path::new(&source))?;
    }
    Ok(serde_json::to_string(&input[1])?)
}

fn source_folder(input: &Value) -> Result<String> {
    let text = |pointer: &str| input.pointer(pointer).and_then(Value::as_str);
    let root = text("/0/root").context("mdBook's input has no root")?;
    let source = text("/0/config/book/src").unwrap_or("src");
    Ok(Path::new(root).join(source).to_string_lossy().into_owned())
}

/// One chapter and those below it; part titles and separators hold no text.
fn chapter(item: &mut Value, source: &Path) -> Result<()> {
    let Some(chapter) = item.get_mut("Chapter") else { return Ok(()) };
    let path = chapter["path"].as_str().unwrap_or_default().to_owned();
    if let Some(text) = chapter["content"].as_str() {
        let text = equations::to_mathml(text);
        chapter["content"] = Value::String(text.with_context(|| format!("{}/{path}", source.display()))?);
    }
    for item in chapter["sub_items"].as_array_mut().into_iter().flatten() {
        self::chapter(item, source)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn input(text: &str) -> String {
        let leaf = json!({"Chapter": {"name": "b", "content": text, "path": "a/b.md", "sub_items": []}});
        let root = json!({"Chapter": {"name": "a", "content": "plain", "path": "a/index.md", "sub_items": [leaf]}});
        let context = json!({"root": "/nowhere", "config": {"book": {"src": "."}}});
        json!([context, {"items": [{"PartTitle": "part"}, root, "Separator"]}]).to_string()
    }

    #[test]
    fn chapters_below_chapters_are_reached_and_the_rest_is_kept() {
        let book: Value = serde_json::from_str(&preprocess(&input("$x$")).unwrap()).unwrap();
        assert_eq!(book["items"][0], json!({"PartTitle": "part"}));
        assert_eq!(book["items"][2], json!("Separator"));
        let root = &book["items"][1]["Chapter"];
        assert_eq!(root["content"], json!("plain"));
        assert!(root["sub_items"][0]["Chapter"]["content"].as_str().unwrap().starts_with("<math"));
    }

    #[test]
    fn a_broken_equation_names_its_page() {
        let error = format!("{:#}", preprocess(&input(r"$\nosuchcommand$")).unwrap_err());
        assert!(error.contains("a/b.md") && error.contains("nosuchcommand"), "{error}");
    }

    #[test]
    fn an_input_of_another_mdbook_is_refused() {
        let error = preprocess(r#"[{"root": "/", "config": {}}, {"sections": []}]"#).unwrap_err();
        assert!(format!("{error:#}").contains("mdBook 0.5"), "{error:#}");
    }
}
