//! Reports in a real browser: every figure drawn, on screen and for paper, no error, no request to anywhere.

use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::Command as Sagnac;
use sagnac_sim::LaggedChamber;
use tempfile::TempDir;

fn testdata(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata").join(name)
}

fn sagnac(folder: &Path, args: &[&str]) {
    Sagnac::cargo_bin("sagnac").unwrap().current_dir(folder).args(args).assert().success();
}

/// Chromium's program.
fn chromium() -> &'static str {
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| Command::new(name).arg("--version").output().is_ok_and(|out| out.status.success()))
        .expect("chromium is missing; on Debian: apt-get install chromium")
}

/// First script of the page: collects all errors.
const LISTEN: &str = r#"<script>
window.wrong = [];
addEventListener("error", (e) => wrong.push("error: " + e.message));
addEventListener("unhandledrejection", (e) => wrong.push("rejection: " + e.reason));
addEventListener("securitypolicyviolation", (e) => wrong.push("request refused: " + e.blockedURI));
for (const level of ["error", "warn"]) console[level] = (...all) => wrong.push(level + ": " + all.join(" "));
</script>"#;

/// Last script: reads the content of each canvas and drawing.
const LOOK: &str = r##"<script>
setTimeout(() => {
  const seen = [...document.querySelectorAll(".plot")].map((plot) => {
    const canvas = plot.querySelector("canvas"), svg = plot.querySelector("svg");
    const pixels = canvas ? canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data : [];
    let coloured = 0;
    for (let i = 0; i < pixels.length; i += 4) {
      const spread = Math.max(pixels[i], pixels[i + 1], pixels[i + 2]) - Math.min(pixels[i], pixels[i + 1], pixels[i + 2]);
      if (pixels[i + 3] > 100 && (spread > 40 || pixels[i] + pixels[i + 1] + pixels[i + 2] < 330)) coloured++;
    }
    const hidden = svg ? getComputedStyle(svg).display : "";
    // As on paper, where the drawing replaces the canvas.
    document.documentElement.classList.remove("live");
    const large = (m) => { const box = m.getBBox(); return box.width + box.height > 100; };
    // Axes and grid are lines of two points; what the figure is about has many, or many bars.
    const corners = (m) => (m.getAttribute("d") || m.getAttribute("points") || "").length;
    const marks = svg
      ? [...svg.querySelectorAll("path, polyline, polygon")].filter((m) => large(m) && corners(m) > 70).length
        + (svg.querySelectorAll("rect").length >= 8 ? 1 : 0)
      : 0;
    const shape = svg ? svg.viewBox.baseVal.width : 0;
    document.documentElement.classList.add("live");
    return { id: plot.id, coloured, marks, shape, hidden };
  });
  const requests = performance.getEntriesByType("resource").map((r) => r.name);
  const answer = document.createElement("pre");
  answer.id = "answer";
  answer.textContent = JSON.stringify({ wrong, seen, requests, figures: document.querySelectorAll("figure").length });
  document.body.append(answer);
}, 300);
</script>"##;

/// Last script of a look at the layout: whatever is wider than its room, on the page or in a table, and text that its box cuts off. A
/// number is in it for each thing that was measured.
const MEASURE: &str = r##"<script>
setTimeout(() => {
  const clipped = [];
  let measured = 0;
  const name = (e) => `${e.tagName}.${e.className} ${(e.textContent || "").trim().slice(0, 40)}`;
  const root = document.documentElement;
  if (root.scrollWidth > root.clientWidth) clipped.push(`page: ${root.scrollWidth} in ${root.clientWidth}`);
  for (const e of document.querySelectorAll(".scroll, figure, .verdict, .tile, .legend, .signatures, td, th, p, h1, h2, h3")) {
    if (getComputedStyle(e).display === "none" || e.closest(".screen")) continue;
    measured++;
    const box = e.getBoundingClientRect();
    if (e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0) clipped.push(`${name(e)}: ${e.scrollWidth} in ${e.clientWidth}`);
    if (box.right > root.clientWidth + 1 || box.left < -1) clipped.push(`${name(e)}: ends at ${Math.round(box.right)} of ${root.clientWidth}`);
  }
  // Each piece of text that is shown.
  const texts = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const text = walk.currentNode.nodeValue.trim(), e = walk.currentNode.parentElement;
    if (text && e.checkVisibility() && !["SCRIPT", "STYLE"].includes(e.tagName)) texts.push(text);
  }
  const lefts = [...document.querySelectorAll(".figures figure")].map((e) => Math.round(e.getBoundingClientRect().left));
  const columns = new Set(lefts).size;
  const answer = document.createElement("pre");
  answer.id = "answer";
  answer.textContent = JSON.stringify({ columns, clipped, measured, texts, wrong, width: root.clientWidth });
  // To the page around this one, whenever it is ready: a busy machine takes its time.
  parent.document.body.append(answer);
}, 300);
</script>"##;

/// Width of the text on A4 within the margins of a report, in the browser's pixels: 182 mm.
const PAPER_PX: u64 = 688;

/// A copy of a report that is on every screen as it is on paper.
fn for_paper(report: &Path) -> PathBuf {
    let page = std::fs::read_to_string(report).unwrap();
    assert!(page.contains("@media print") && page.contains("@media screen"), "{}", report.display());
    let path = report.with_extension("paper.html");
    std::fs::write(&path, page.replace("@media print", "@media all").replace("@media screen", "@media print")).unwrap();
    path
}

/// What a browser of this width cuts off in a report.
fn measured(chromium: &str, report: &Path, width: u64, flags: &[&str]) -> serde_json::Value {
    let page = std::fs::read_to_string(report).unwrap();
    // A window has a least width, so that a frame of the width in question holds the page.
    let inner =
        page.replacen("<head>", &format!("<head>{LISTEN}"), 1).replacen("</body>", &format!("{MEASURE}</body>"), 1);
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("inner.html"), inner).unwrap();
    let outer = format!(
        "<!DOCTYPE html><body style='margin:0'><iframe src=inner.html style='border:0;width:{width}px;height:3000px'></iframe>"
    );
    std::fs::write(folder.path().join("outer.html"), outer).unwrap();
    let output = Command::new(chromium)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--allow-file-access-from-files"])
        .args([
            "--disable-background-networking",
            "--virtual-time-budget=60000",
            "--window-size=2000,3000",
            "--dump-dom",
        ])
        .args(flags)
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", folder.path().join("outer.html").display()))
        .output()
        .unwrap();
    let dom = String::from_utf8(output.stdout).unwrap();
    let answer = dom.rsplit_once("<pre id=\"answer\">").unwrap().1.split_once("</pre>").unwrap().0;
    let answer = answer.replace("&quot;", "\"").replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    serde_json::from_str(&answer).unwrap_or_else(|e| panic!("{}: {e}: {answer}", report.display()))
}

/// A log of three axes, each the rows of one cycle.
fn three_axes(folder: &Path, name: &str, seed: u64) {
    let head = "time_s,temperature_c,counts_x,counts_y,counts_z\n";
    let text: String = LaggedChamber::domain_notes()
        .run(seed)
        .map(|row| format!("{},{},{},{},{}\n", row.time_s, row.temperature_c, row.counts, row.counts, row.counts))
        .collect();
    std::fs::write(folder.join(name), format!("{head}{text}")).unwrap();
}

/// Every kind of report on a telephone, a tablet, a laptop and a large screen, light and dark: nothing is cut off.
#[test]
fn nothing_is_clipped_at_any_width() {
    let chromium = chromium();
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let file = |name: &str| testdata(name).display().to_string();
    let (one, two, three) =
        (file("chamber/cycle-1.csv.gz"), file("chamber/cycle-2.csv.gz"), file("chamber/retest.csv.gz"));
    let (setup, limits) = (file("chamber/bench.toml"), file("chamber/acceptance.toml"));
    three_axes(at, "a.csv", 1);
    three_axes(at, "b.csv", 2);
    let fit = |log: &str, out: &str, more: &[&str]| {
        sagnac(at, &[&["calibrate", log, "--setup", &setup, "-o", out], more].concat());
    };
    fit(&one, "1.json", &["--tradeoff", "--report", "fit.html"]);
    fit(&two, "2.json", &["--model", "bias 3, rate 0"]);
    let flags = ["--arcsec-per-count", "0.15125", "--model", "bias 3, rate 0", "-o", "3.json", "--serial", "RLG-3"];
    sagnac(at, &[&["calibrate", "a.csv"][..], &flags].concat());
    // A page of a refusal is looked at like one of an acceptance.
    let verify = |args: &[&str]| {
        let _ = Sagnac::cargo_bin("sagnac").unwrap().current_dir(at).arg("verify").args(args).assert();
    };
    verify(&["1.json", &three, "--limits", &limits, "--report", "acceptance.html", "--document", "T-104"]);
    verify(&["3.json", "b.csv", "--limits", "navigation-grade", "--report", "axes.html"]);
    sagnac(at, &["allan", "a.csv", "--arcsec-per-count", "0.15125", "--report", "noise.html"]);
    sagnac(at, &["compare", "1.json", "2.json", "--report", "compare.html"]);
    sagnac(at, &["inspect", "a.csv", "--arcsec-per-count", "0.15125", "--report", "survey.html"]);
    for name in ["fit", "acceptance", "axes", "noise", "compare", "survey"] {
        let report = at.join(format!("{name}.html"));
        for width in [380, 768, 1280, 1920] {
            let answer = measured(chromium, &report, width, &[]);
            assert_eq!(answer["clipped"], serde_json::json!([]), "{name} at {width}");
            assert_eq!(answer["wrong"], serde_json::json!([]), "{name} at {width}");
            let columns = if width >= 1600 { 2 } else { 1 };
            assert_eq!(answer["columns"], columns, "{name} at {width}: columns of figures");
            // Less a bar for scrolling.
            let seen = answer["width"].as_u64().unwrap();
            assert!(
                answer["measured"].as_u64().unwrap() > 40 && seen <= width && seen + 20 > width,
                "{name}: {answer}"
            );
        }
        let dark = measured(chromium, &report, 380, &["--blink-settings=preferredColorScheme=0"]);
        assert_eq!(dark["clipped"], serde_json::json!([]), "{name} in the dark");
    }
    // The look sees what is too wide.
    let good = std::fs::read_to_string(at.join("fit.html")).unwrap();
    let wide = good.replacen("<main>", "<main><p style='white-space:nowrap'>".to_owned().as_str(), 1);
    let wide = wide.replacen("white-space:nowrap'>", &format!("white-space:nowrap'>{}</p>", "too wide ".repeat(60)), 1);
    std::fs::write(at.join("wide.html"), wide).unwrap();
    assert_ne!(measured(chromium, &at.join("wide.html"), 380, &[])["clipped"], serde_json::json!([]));
}

/// The pages of a report on paper, each as its text without blanks: cells one after the other, each whole, and nothing of what is off the
/// page.
fn pages(chromium: &str, report: &Path) -> Vec<String> {
    let folder = TempDir::new().unwrap();
    let pdf = folder.path().join("report.pdf");
    let status = Command::new(chromium)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"])
        .args(["--virtual-time-budget=6000", "--no-pdf-header-footer"])
        .arg(format!("--print-to-pdf={}", pdf.display()))
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", report.display()))
        .output()
        .unwrap();
    assert!(status.status.success() && pdf.exists(), "{}", String::from_utf8_lossy(&status.stderr));
    let text = Command::new("pdftotext").args(["-raw", "-enc", "UTF-8"]).arg(&pdf).arg("-").output();
    let text = text.expect("pdftotext is missing; on Debian: apt-get install poppler-utils");
    String::from_utf8(text.stdout).unwrap().split_terminator('\u{c}').map(without_blanks).collect()
}

fn without_blanks(text: &str) -> String {
    text.chars().filter(|c| !c.is_whitespace()).collect()
}

/// Text of a report on paper that none of its pages has, or fewer times: each piece of text of the document, without blanks. The foot of
/// a page may stand in a paragraph that goes on.
fn lost(answer: &serde_json::Value, pages: &[String]) -> Vec<String> {
    let paper = pages.concat();
    let mut wanted: std::collections::BTreeMap<String, usize> = std::collections::BTreeMap::new();
    for text in answer["texts"].as_array().unwrap() {
        *wanted.entry(without_blanks(text.as_str().unwrap())).or_default() += 1;
    }
    assert!(wanted.len() > 100, "{answer}");
    wanted
        .into_iter()
        .filter(|(text, times)| paper.matches(text.as_str()).count() < *times)
        .map(|(text, _)| text)
        .collect()
}

/// What an acceptance lacks on its first page: head, verdict, every limit that is asked, both signatures.
fn lacking(page_one: &str, limits: &serde_json::Value) -> Vec<String> {
    let mut wanted: Vec<String> = [
        "Acceptance test: RLG-3",
        "limits met",
        "T-104",
        "2026-11-20",
        "2026-11-23",
        "A. N. Other",
        "pier 4, Munich",
        "Tested by",
        "Accepted by",
        "Not asked of any axis",
    ]
    .map(str::to_owned)
    .to_vec();
    let asked: Vec<&serde_json::Value> =
        limits.as_array().unwrap().iter().filter(|limit| !limit["pass"].is_null()).collect();
    assert!(asked.len() >= 17, "{limits}");
    for limit in asked {
        let spec = sagnac::verify::SPECS.iter().find(|spec| spec.key == limit["name"]).unwrap();
        wanted.push(spec.label.to_owned());
    }
    let mut missing: Vec<String> =
        wanted.into_iter().filter(|text| !page_one.contains(&without_blanks(text))).collect();
    for line in ["Name", "Date", "Signature"] {
        if page_one.matches(line).count() != 2 {
            missing.push(format!("two lines of {line}"));
        }
    }
    missing
}

/// An acceptance of three axes on paper, with as many limits as one test can have: its first page is signed, and no page loses a word.
#[test]
fn an_acceptance_of_three_axes_is_signed_on_its_first_page() {
    let chromium = chromium();
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    three_axes(at, "a.csv", 1);
    three_axes(at, "b.csv", 2);
    let setup = "serial = \"RLG-3\"\nsensor = \"ring laser gyro, three axes, block 0042 (simulated)\"\n\
                 rig = \"thermal chamber 2, rate table of the old laboratory, pier 4, Munich\"\narcsec_per_count = 0.15125\n";
    std::fs::write(at.join("bench.toml"), setup).unwrap();
    let limits = std::fs::read_to_string(testdata("chamber/acceptance.toml")).unwrap();
    let specification = "[specification]\ncustomer = \"Example Aerospace\"\npart = \"4711-23\"\nrevision = \"C\"\n\
                         number = \"SPEC-1044 issue 2\"\nparagraphs = { arw_deg_rt_h_max = \"3.3.7\" }\n";
    let limits = format!("base = \"navigation-grade\"\n{limits}\n{specification}");
    std::fs::write(at.join("limits.toml"), limits).unwrap();
    sagnac(at, &["calibrate", "a.csv", "--setup", "bench.toml", "--model", "bias 3, rate 0", "-o", "3.json"]);
    let head = ["--document", "T-104", "--operator", "A. N. Other", "--test-date", "2026-11-20"];
    let verify = ["verify", "3.json", "b.csv", "--limits", "limits.toml", "--json", "--report", "axes.html"];
    let mut command = Sagnac::cargo_bin("sagnac").unwrap();
    let output =
        command.current_dir(at).args(verify).args(head).args(["--report-date", "2026-11-23"]).output().unwrap();
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let (report, limits) = (at.join("axes.html"), &found["axes"][0]["limits"]);
    let seen = |report: &Path| {
        let pages = pages(chromium, report);
        let answer = measured(chromium, &for_paper(report), PAPER_PX, &[]);
        assert!(answer["measured"].as_u64().unwrap() > 200, "{answer}");
        (lacking(&pages[0], limits), lost(&answer, &pages), answer["clipped"].clone())
    };
    let nothing = serde_json::json!([]);
    assert_eq!(seen(&report), (Vec::new(), Vec::new(), nothing.clone()));
    let printed = pages(chromium, &report);
    assert!(printed.iter().all(|page| page.contains("T-104:AcceptanceRLG-3")), "a page lacks the document's number");
    for words in ["ExampleAerospace", "4711-23,revisionC", "SPEC-1044issue2", "(§3.3.7)"] {
        assert!(without_blanks(&printed[0]).contains(words), "{words}: {}", printed[0]);
    }
    // The verdict and what it says stand on two pages; the rest is an annex.
    let annex = printed.iter().position(|page| page.contains("Annex:")).unwrap();
    assert!(annex <= 2 && printed[..annex].iter().any(|page| page.contains("Decisionruleapplied:guarded")), "{annex}");
    // The look sees a page break in the wrong place, a table that leaves the page, and a box that cuts off.
    let page = std::fs::read_to_string(&report).unwrap();
    let spoiled = |style: &str| {
        let path = at.join("spoiled.html");
        std::fs::write(&path, page.replacen("</head>", &format!("<style>{style}</style></head>"), 1)).unwrap();
        seen(&path)
    };
    let (lacking, ..) = spoiled(".signatures { break-before: page !important; }");
    assert_eq!(
        lacking,
        ["Tested by", "Accepted by", "two lines of Name", "two lines of Date", "two lines of Signature"]
    );
    let (_, lost, _) = spoiled("@media print { td.judged { position: relative; left: 1600px; } }");
    assert!(lost.len() > 10, "{lost:?}");
    let (_, _, clipped) = spoiled("@media print { .scroll { overflow: hidden !important; max-width: 9cm; } }");
    assert_ne!(clipped, nothing);
}

/// An acceptance of one axis is signed on its first page too. Each page has the document's number, letter by letter.
#[test]
fn an_acceptance_of_one_axis_is_signed_on_its_first_page() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| testdata(&format!("chamber/{name}")).display().to_string();
    let (one, two, setup) = (file("cycle-1.csv.gz"), file("cycle-2.csv.gz"), file("bench.toml"));
    let limits = std::fs::read_to_string(file("acceptance.toml")).unwrap();
    let strict = limits.replace("plateau_offset_dph_max = 0.01", "plateau_offset_dph_max = 0.0001");
    assert_ne!(strict, limits);
    let paragraphs =
        "[specification.paragraphs]\nplateau_offset_dph_max = \"3.2.1\"\nimprovement_sigma_min = \"3.2.2\"\n";
    std::fs::write(folder.path().join("limits.toml"), format!("{strict}{paragraphs}")).unwrap();
    sagnac(folder.path(), &["calibrate", &one, "--setup", &setup, "--model", "bias 3, rate 0", "-o", "u.json"]);
    let head = ["--report", "one.html", "--document", "T#104 \"B\" & <7>"];
    let mut command = Sagnac::cargo_bin("sagnac").unwrap();
    let verify = command.current_dir(folder.path()).args(["verify", "u.json", &two, "--limits", "limits.toml"]);
    verify.args(head).assert().code(1);
    let pages = pages(chromium(), &folder.path().join("one.html"));
    for words in ["largest (§3.2.1)", "not met at", "bias repeatability, largest", "Tested by", "Accepted by"] {
        assert!(pages[0].contains(&without_blanks(words)), "{words}: {}", pages[0]);
    }
    assert!(pages.iter().all(|page| page.contains("T#104\"B\"&<7>:AcceptanceRLG-0001")), "{pages:?}");
    let annex = pages.iter().position(|page| page.contains("Annex:")).unwrap();
    assert!(annex <= 2 && pages[..annex].concat().contains("Decisionruleapplied:simple"), "{pages:?}");
}

/// Findings of the browser in a report.
fn look_at(chromium: &str, report: &Path) -> serde_json::Value {
    let page = std::fs::read_to_string(report).unwrap();
    let page = page.replacen("<head>", &format!("<head>{LISTEN}"), 1).replacen("</body>", &format!("{LOOK}</body>"), 1);
    let folder = TempDir::new().unwrap();
    let copy = folder.path().join("report.html");
    std::fs::write(&copy, page).unwrap();
    let net_log = folder.path().join("net.json");
    let output = Command::new(chromium)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
            "--disable-sync",
            "--disable-extensions",
        ])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-default-apps"])
        .args(["--virtual-time-budget=6000", "--window-size=1100,1600", "--enable-logging=stderr", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("--log-net-log={}", net_log.display()))
        .arg(format!("file://{}", copy.display()))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let console: Vec<&str> = said.lines().filter(|line| line.contains("CONSOLE")).collect();
    let dom = String::from_utf8(output.stdout).unwrap();
    let answer = dom.split_once("<pre id=\"answer\">").unwrap().1.split_once("</pre>").unwrap().0;
    let answer = answer.replace("&quot;", "\"").replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    // The page's own word on requests, and the browser's.
    let log = std::fs::read_to_string(net_log).unwrap();
    assert!(log.contains(&format!("file://{}", copy.display())), "the network log does not even know the page");
    let is_address = |text: &&str| ["http://", "https://", "ws://", "wss://"].iter().any(|p| text.starts_with(p));
    // Chromium requests updates and the time from its maker, whatever its flags are.
    let its_own = |text: &&str| ["google.com", "googleapis.com"].iter().any(|host| text.contains(host));
    let outside: Vec<&str> = log.split('"').filter(is_address).filter(|text| !its_own(text)).collect();
    let mut answer: serde_json::Value = serde_json::from_str(&answer).unwrap();
    answer["console"] = serde_json::json!(console);
    answer["outside"] = serde_json::json!(outside);
    answer
}

fn must_be_drawn(chromium: &str, report: &Path, least_figures: u64) {
    let answer = look_at(chromium, report);
    let name = report.display();
    for list in ["wrong", "console", "requests", "outside"] {
        assert_eq!(answer[list], serde_json::json!([]), "{name}: {list}");
    }
    let seen = answer["seen"].as_array().unwrap();
    assert!(seen.len() as u64 >= least_figures && answer["figures"] == seen.len(), "{name}: {answer}");
    for figure in seen {
        assert!(figure["coloured"].as_u64().unwrap() > 300, "{name}: an empty canvas: {figure}");
        assert!(figure["marks"].as_u64().unwrap() > 0, "{name}: an empty drawing: {figure}");
        assert_eq!(figure["hidden"], "none", "{name}: two drawings at once: {figure}");
    }
}

#[test]
fn a_browser_draws_every_figure_of_every_report() {
    let chromium = chromium();
    let folder = TempDir::new().unwrap();
    let file = |name: &str| testdata(name).display().to_string();
    let (one, two, three) =
        (file("chamber/cycle-1.csv.gz"), file("chamber/cycle-2.csv.gz"), file("chamber/retest.csv.gz"));
    let (setup, limits) = (file("chamber/bench.toml"), file("chamber/limits.toml"));
    sagnac(folder.path(), &["calibrate", &one, &two, "--setup", &setup, "-o", "u.json", "--report", "fit.html"]);
    sagnac(folder.path(), &["verify", "u.json", &three, "--limits", &limits, "--report", "proof.html"]);
    sagnac(folder.path(), &["simulate", "--paper", "--report", "demo.html"]);
    must_be_drawn(chromium, &folder.path().join("fit.html"), 6);
    let fit = std::fs::read_to_string(folder.path().join("fit.html")).unwrap();
    for words in ["95 % band", "What to expect at rest", "Drift against the rate of"] {
        assert!(fit.contains(words), "{words}");
    }
    must_be_drawn(chromium, &folder.path().join("proof.html"), 5);
    must_be_drawn(chromium, &folder.path().join("demo.html"), 4);
}

/// Noise budget, rate table, comparison, and an acceptance with a flight.
#[test]
fn a_browser_draws_the_reports_of_a_whole_calibration() {
    let chromium = chromium();
    let folder = TempDir::new().unwrap();
    let file = |name: &str| testdata(name).display().to_string();
    let (one, two, three) =
        (file("chamber/cycle-1.csv.gz"), file("chamber/cycle-2.csv.gz"), file("chamber/retest.csv.gz"));
    let (setup, limits) = (file("chamber/bench.toml"), file("chamber/acceptance.toml"));
    sagnac(folder.path(), &["allan", &one, "--setup", &setup, "--report", "noise.html"]);
    sagnac(folder.path(), &["calibrate", &one, "--setup", &setup, "--model", "bias 3, rate 0", "-o", "1.json"]);
    sagnac(folder.path(), &["calibrate", &two, "--setup", &setup, "--model", "bias 3, rate 0", "-o", "2.json"]);
    sagnac(folder.path(), &["compare", "1.json", "2.json", "--report", "compare.html"]);
    sagnac(folder.path(), &["verify", "1.json", &three, "--limits", &limits, "--report", "acceptance.html"]);
    for seed in 1..=2 {
        let log = sagnac_sim::RateTable::domain_notes().csv(seed, true);
        std::fs::write(folder.path().join(format!("table-{seed}.csv")), log).unwrap();
    }
    let flags = ["--arcsec-per-count", "1.059", "--model", "bias 2, scale 2", "-o", "t.json", "--report", "table.html"];
    sagnac(folder.path(), &[&["calibrate", "table-1.csv"][..], &flags].concat());
    sagnac(folder.path(), &["verify", "t.json", "table-2.csv", "--report", "ppm.html"]);
    for (name, figures) in [("noise", 2), ("compare", 2), ("acceptance", 6), ("table", 6), ("ppm", 5)] {
        must_be_drawn(chromium, &folder.path().join(format!("{name}.html")), figures);
    }
    let table = std::fs::read_to_string(folder.path().join("table.html")).unwrap();
    assert!(table.contains("95 % of other windows at rest"));
    let page = std::fs::read_to_string(folder.path().join("acceptance.html")).unwrap();
    for words in ["Accepted: 14 of 14 limits met", "Tested by", "Signature", "Position error of the stated flight"] {
        assert!(page.contains(words), "{words}");
    }
}

/// A page with a script that loads something, and a page with a missing figure, must fail.
#[test]
fn the_look_itself_sees_what_is_wrong() {
    let chromium = chromium();
    let folder = TempDir::new().unwrap();
    sagnac(folder.path(), &["simulate", "--paper", "--report", "demo.html"]);
    let path = folder.path().join("demo.html");
    let good = std::fs::read_to_string(&path).unwrap();
    let broken = good
        .replace("all();\nmatchMedia", "matchMedia")
        .replace("<main>", "<main><img src=\"http://127.0.0.1:9/x.png\"><script>no_such_function()</script>");
    assert_ne!(good, broken);
    std::fs::write(&path, broken).unwrap();
    let answer = look_at(chromium, &path);
    let wrong = answer["wrong"].to_string();
    assert!(wrong.contains("no_such_function") && wrong.contains("request refused"), "{wrong}");
    assert!(answer["seen"].as_array().unwrap().iter().all(|figure| figure["coloured"] == 0));
}
