//! `tessera study`.

use std::path::Path;
use std::process::Command;

use super::{Bench, SCENE};

const SMALL: [&str; 14] = [
    "study",
    "scene.pbrt",
    "-o",
    "out",
    "--spp",
    "1,4,8",
    "--filter",
    "none,adaptive",
    "--seeds",
    "2",
    "--reference-spp",
    "64",
    "--resolution",
    "48x32",
];

#[test]
fn a_study_is_a_page_with_its_figures_and_goes_on_where_it_was() {
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    bench.succeed(&SMALL);
    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(bench.path("out/study.json")).unwrap()).unwrap();
    let points = report["points"].as_array().unwrap();
    assert_eq!(points.len(), 6);
    let error = |k: usize| points[k]["relmse"].as_f64().unwrap();
    // Eight times the samples: at most a quarter of the error, and it stays an error.
    assert!(error(2) < 0.25 * error(0) && error(2) > 0.0, "{report}");
    assert_eq!(std::fs::read_to_string(bench.path("out/study.csv")).unwrap().lines().count(), 7);

    let page = std::fs::read_to_string(bench.path("out/index.html")).unwrap();
    assert!(page.contains("For a relMSE of 0.01") || page.contains("No setting comes near"), "no verdict");
    // Nothing from outside: the only addresses are the pictures within.
    for (at, _) in page.match_indices("url(") {
        assert!(page[at..].starts_with("url(data:image/png;base64,"), "{}", &page[at..at + 40]);
    }
    assert!(!page.contains("http") && !page.contains("src=") && !page.contains("<link"), "an external resource");

    // Again with one more budget: what is there stays as it is.
    let old = bench.path("out/renders/none-000008-1.exr");
    let written = std::fs::metadata(&old).unwrap().modified().unwrap();
    let mut more = SMALL;
    more[5] = "1,4,8,16";
    bench.succeed(&more);
    assert_eq!(std::fs::metadata(&old).unwrap().modified().unwrap(), written);
    assert!(bench.path("out/renders/adaptive-000016-2.exr").is_file());
    open_in_browser(&bench.path("out/index.html"));
}

/// Opens the page where there is a browser: its script must have run, and without a word on the console.
#[allow(clippy::print_stderr)]
fn open_in_browser(page: &Path) {
    let script = r#"<p id="left-picture"></p><script>
        const layer = document.querySelector(".slider .over");
        document.querySelector(".slider input").value = 25;
        document.querySelector(".slider input").dispatchEvent(new Event("input"));
        const at = document.querySelector(".slider").style.getPropertyValue("--at");
        const wide = document.documentElement.scrollWidth > window.innerWidth;
        document.getElementById("left-picture").textContent = `picture ${layer.style.backgroundImage} at ${at} wide ${wide}`;
        </script></body>"#;
    let probe = page.with_file_name("probe.html");
    std::fs::write(&probe, std::fs::read_to_string(page).unwrap().replace("</body>", script)).unwrap();
    let browser = ["chromium", "chromium-browser", "google-chrome"].into_iter().find_map(|name| {
        let mut command = Command::new(name);
        command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1200,900", "--dump-dom"]);
        command.arg(format!("--user-data-dir={}", page.with_file_name("browser").display()));
        command.arg(format!("file://{}", probe.display())).output().ok()
    });
    let Some(output) = browser else {
        eprintln!("SKIPPED: there is no Chromium, so the page was not opened in a browser");
        return;
    };
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(shown.contains("picture var(--p0) at 25% wide false"), "{}", &shown[shown.len().saturating_sub(900)..]);
    let console = String::from_utf8_lossy(&output.stderr);
    assert!(!console.contains("CONSOLE"), "{console}");
}

#[test]
fn what_cannot_be_studied_is_refused_before_anything_is_rendered() {
    let bench = Bench::new();
    bench.write("scene.pbrt", SCENE);
    let with = |more: &[&'static str]| [&["study", "scene.pbrt", "-o", "out"], more].concat();
    bench.fail(&with(&["--variant", "none=adaptive"]), 2, &["none", "--variant"]);
    bench.fail(&with(&["--variant", "fine=adaptive,leef=2"]), 2, &["leef"]);
    bench.fail(&with(&["--reference", "a.exr"]), 2, &["two images"]);
    bench.fail(&with(&["--spp", "18446744073709551615"]), 2, &["18446744073709551615", "8388608"]);
    bench.fail(&with(&["--reference-spp", "8388609"]), 2, &["8388609"]);
    assert_eq!(bench.files(), ["scene.pbrt"]);
    bench.fail(&["study", "absent.pbrt", "-o", "out"], 3, &["absent.pbrt"]);
    // More than any machine has.
    bench.write(
        "large.pbrt",
        &SCENE
            .replace("xresolution\" 48", "xresolution\" 1000000")
            .replace("yresolution\" 32", "yresolution\" 1000000"),
    );
    bench.fail(&["study", "large.pbrt", "-o", "out", "--spp", "1"], 1, &["more than there is memory"]);
}
