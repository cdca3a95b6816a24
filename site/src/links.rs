//! The check of a built site: every link and anchor leads somewhere, every page of `docs/` is in the book, and no page
//! loads anything from outside.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::html::{Tag, tags};

/// Folder of the site that rustdoc wrote; rustdoc checks its own links.
const RUSTDOC: &str = "api";

/// All findings, sorted; empty for a good site.
pub(crate) fn check(docs: &Path, site: &Path) -> Result<Vec<String>> {
    let mut findings = missing_pages(docs)?;
    let files = files(site)?;
    let pages: BTreeMap<&Path, Page> = files
        .iter()
        .filter(|file| file.extension().is_some_and(|ext| ext == "html"))
        .map(|file| Ok((file.as_path(), Page::read(site, file)?)))
        .collect::<Result<_>>()?;
    let own = || files.iter().filter(|file| !file.starts_with(RUSTDOC));
    ensure!(own().count() > 1, "{} holds no site", site.display());
    for file in own() {
        if let Some(page) = pages.get(file.as_path()) {
            findings.extend(page.links.iter().filter_map(|link| broken(file, link, &files, &pages)));
        } else if file.extension().is_some_and(|ext| ext == "css") {
            let text = fs::read_to_string(site.join(file))?;
            findings.extend(of_style(&text).iter().filter_map(|link| broken(file, link, &files, &pages)));
        }
    }
    findings.sort();
    findings.dedup();
    Ok(findings)
}

/// Pages of `docs/` that SUMMARY.md does not list.
fn missing_pages(docs: &Path) -> Result<Vec<String>> {
    let summary = docs.join("SUMMARY.md");
    let text = fs::read_to_string(&summary).with_context(|| format!("cannot read {}", summary.display()))?;
    let listed: BTreeSet<PathBuf> = text
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next())
        .map(|path| normal(Path::new(path)))
        .collect();
    let pages = files(docs)?;
    let pages = pages.iter().filter(|file| file.extension().is_some_and(|ext| ext == "md"));
    let missing = pages.filter(|page| !listed.contains(*page) && page.as_path() != Path::new("SUMMARY.md"));
    Ok(missing.map(|page| format!("{}: not in SUMMARY.md", page.display())).collect())
}

/// All files below a folder, relative to it.
fn files(folder: &Path) -> Result<BTreeSet<PathBuf>> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).with_context(|| format!("cannot read {}", next.display()))? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(folder)?.to_owned());
            }
        }
    }
    Ok(found)
}

/// An address in a page, and whether the page loads it.
#[derive(Debug, PartialEq, Eq)]
struct Link {
    address: String,
    loaded: bool,
}

/// What a check needs of a page.
struct Page {
    anchors: BTreeSet<String>,
    links: Vec<Link>,
}

impl Page {
    fn read(site: &Path, file: &Path) -> Result<Self> {
        let text = fs::read_to_string(site.join(file)).with_context(|| format!("cannot read {}", file.display()))?;
        Ok(Self::of(&text))
    }

    fn of(text: &str) -> Self {
        let tags = tags(text);
        let anchors = tags.iter().flat_map(|tag| [tag.get("id"), tag.get("name")]).flatten().map(str::to_owned);
        Self { anchors: anchors.collect(), links: tags.iter().flat_map(links).collect() }
    }
}

/// Addresses of a tag.
fn links(tag: &Tag<'_>) -> Vec<Link> {
    let mut found = Vec::new();
    // mdBook's script asks this server what an example may use, as soon as a page has one that can be run.
    if tag.get("class").is_some_and(|class| class.split_whitespace().any(|name| name == "playground")) {
        found.push(Link { address: "https://play.rust-lang.org/".to_owned(), loaded: true });
    }
    for key in ["href", "src", "data", "poster", "xlink:href"] {
        if let Some(address) = tag.get(key) {
            found.push(Link { address: address.to_owned(), loaded: tag.name != "a" });
        }
    }
    for candidate in tag.get("srcset").unwrap_or_default().split(',').filter_map(|part| part.split_whitespace().next())
    {
        found.push(Link { address: candidate.to_owned(), loaded: true });
    }
    found.extend(of_style(tag.get("style").unwrap_or_default()));
    if tag.name == "style" {
        found.extend(of_style(tag.text));
    }
    found
}

/// Addresses of a style sheet: `url(…)` and `@import "…"`.
fn of_style(text: &str) -> Vec<Link> {
    let urls = text.split("url(").skip(1).filter_map(|rest| rest.split(')').next());
    let imports = text.split("@import").skip(1).filter_map(|rest| rest.split(';').next());
    let imports = imports.filter(|import| !import.contains("url("));
    let bare = |address: &str| address.trim().trim_matches(['"', '\'']).to_owned();
    urls.chain(imports).map(|address| Link { address: bare(address), loaded: true }).collect()
}

/// What is wrong with a link of this file, if anything is.
fn broken(file: &Path, link: &Link, files: &BTreeSet<PathBuf>, pages: &BTreeMap<&Path, Page>) -> Option<String> {
    let address = link.address.as_str();
    let finding = |what: &str| Some(format!("{}: {address}: {what}", file.display()));
    if address.starts_with("data:") {
        return None;
    }
    if address.starts_with("//") || address.split_once(':').is_some_and(|(scheme, _)| is_scheme(scheme)) {
        return if link.loaded { finding("loaded from outside") } else { None };
    }
    let (path, anchor) = address.split_once('#').unwrap_or((address, ""));
    let path = path.split('?').next().unwrap_or_default();
    let target = match path {
        "" => file.to_owned(),
        _ if path.starts_with('/') => return finding("begins at the root of a server; write it relative to the page"),
        _ => normal(&file.parent().unwrap_or(Path::new("")).join(path)),
    };
    let target = if path.ends_with('/') { target.join("index.html") } else { target };
    if !files.contains(&target) {
        return finding("no such file in the site");
    }
    match pages.get(target.as_path()) {
        Some(page) if !anchor.is_empty() && !page.anchors.contains(anchor) => finding("no such anchor there"),
        _ => None,
    }
}

/// `http`, `mailto` and the like.
fn is_scheme(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "+.-".contains(c))
}

/// A path without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                out.pop();
            }
            Component::CurDir => {}
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A site of two pages, a picture and a style sheet; `page` and `style` are what a test puts in.
    fn findings(summary: &str, page: &str, style: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let (docs, site) = (folder.path().join("docs"), folder.path().join("site"));
        let write = |path: PathBuf, text: &str| {
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write(docs.join("SUMMARY.md"), summary);
        write(docs.join("index.md"), "");
        write(docs.join("how-to/one.md"), "");
        write(site.join("index.html"), "<h1 id=\"top\">x</h1><a href=\"how-to/one.html#here\">one</a>");
        write(site.join("how-to/one.html"), page);
        write(site.join("pictures/a.png"), "");
        write(site.join("css/a.css"), style);
        write(site.join("api/index.html"), "<a href=\"gone.html\">rustdoc's own</a>");
        check(&docs, &site).unwrap()
    }

    const SUMMARY: &str = "[a](index.md)\n- [b](./how-to/one.md)";
    const PAGE: &str = "<i id=\"here\"></i><img src=\"../pictures/a.png\"><a href=\"../index.html#top\"></a>\
        <a href=\"#here\"></a><a href=\"https://example.org/\"></a><a href=\"mailto:a@example.org\"></a><a href=\"../api/\"></a>";

    #[test]
    fn a_good_site_has_no_findings() {
        let style = "@font-face{src:url('../pictures/a.png')} b{background:url(data:image/png;base64,AA)}";
        assert_eq!(findings(SUMMARY, PAGE, style), Vec::<String>::new());
    }

    #[test]
    fn broken_links_and_anchors_are_found() {
        let page =
            format!("{PAGE}<a href=\"two.html\"></a><a href=\"../index.html#bottom\"></a><a href=\"/index.html\"></a>");
        let found = findings(SUMMARY, &page, "");
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found[0].starts_with("how-to/one.html: ../index.html#bottom: no such anchor"), "{found:?}");
        assert!(found[1].contains("/index.html: begins at the root") && found[2].contains("two.html: no such file"));
        let found = findings(SUMMARY, "no anchor", "");
        assert_eq!(found, ["index.html: how-to/one.html#here: no such anchor there"]);
    }

    #[test]
    fn what_is_loaded_from_outside_is_found() {
        let loads = [
            "<pre><pre class=\"playground\"></pre></pre>",
            "<script src=\"https://cdn.example.org/a.js\"></script>",
            "<link rel=\"stylesheet\" href=\"//cdn.example.org/a.css\">",
            "<img src=\"http://example.org/a.png\">",
            "<img src=\"../pictures/a.png\" srcset=\"https://example.org/a.png 2x\">",
            "<style>b{background:url(https://example.org/b.png)}</style>",
            "<i style=\"background:url('https://example.org/b.png')\"></i>",
        ];
        for load in loads {
            let found = findings(SUMMARY, &format!("{PAGE}{load}"), "");
            assert!(found.len() == 1 && found[0].ends_with("loaded from outside"), "{load}: {found:?}");
        }
        for style in ["@import \"https://example.org/a.css\";", "a{src:url(https://example.org/f.woff2)}"] {
            let found = findings(SUMMARY, PAGE, style);
            assert!(found.len() == 1 && found[0].ends_with("loaded from outside"), "{style}: {found:?}");
        }
        assert_eq!(findings(SUMMARY, PAGE, "a{src:url(f.woff2)}"), ["css/a.css: f.woff2: no such file in the site"]);
    }

    #[test]
    fn a_page_that_the_book_forgot_is_found() {
        assert_eq!(findings("[a](index.md)", PAGE, ""), ["how-to/one.md: not in SUMMARY.md"]);
    }

    #[test]
    fn an_empty_folder_is_no_site() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("SUMMARY.md"), "").unwrap();
        fs::create_dir(folder.path().join("site")).unwrap();
        assert!(check(folder.path(), &folder.path().join("site")).is_err());
    }
}
