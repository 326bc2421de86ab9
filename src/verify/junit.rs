//! Reports as JUnit XML, which build servers show.

use super::Report;
use crate::error::Error;
use std::fmt::Write;
use std::path::PathBuf;

/// The reports as one document: a suite per file, a case per check; files that could not be judged are errors.
pub fn xml(reports: &[Report], errors: &[(PathBuf, Error)]) -> String {
    let failures: usize = reports.iter().map(Report::failures).sum();
    let tests: usize = reports.iter().map(|r| r.checks.len()).sum::<usize>() + errors.len();
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"kiln verify\" tests=\"{tests}\" failures=\"{failures}\" errors=\"{}\">\n",
        errors.len()
    );
    for report in reports {
        let file = escaped(&report.file.display().to_string());
        let (n, failed, skipped) = (report.checks.len(), report.failures(), report.skipped.len());
        let _ = writeln!(
            xml,
            "  <testsuite name=\"{file}\" tests=\"{}\" failures=\"{failed}\" errors=\"0\" skipped=\"{skipped}\">",
            n + skipped
        );
        for check in &report.checks {
            let name = escaped(&format!("{} of {}", check.name, check.subject));
            let _ = write!(xml, "    <testcase classname=\"{file}\" name=\"{name}\"");
            if check.passed {
                xml += "/>\n";
            } else {
                let message = escaped(&format!(
                    "found {:.3e} where at most {:.3e} is right, {}",
                    check.figure, check.limit, check.detail
                ));
                let _ = write!(xml, ">\n      <failure message=\"{message}\"/>\n    </testcase>\n");
            }
        }
        for reason in &report.skipped {
            let reason = escaped(reason);
            let _ = write!(
                xml,
                "    <testcase classname=\"{file}\" name=\"{reason}\">\n      <skipped/>\n    </testcase>\n"
            );
        }
        if !report.notes.is_empty() {
            let _ = writeln!(xml, "    <system-out>{}</system-out>", escaped(&report.notes.join("\n")));
        }
        xml += "  </testsuite>\n";
    }
    for (path, error) in errors {
        let (file, message) = (escaped(&path.display().to_string()), escaped(&error.to_string()));
        let _ = write!(
            xml,
            "  <testsuite name=\"{file}\" tests=\"1\" failures=\"0\" errors=\"1\" skipped=\"0\">\n    \
             <testcase classname=\"{file}\" name=\"can be judged\">\n      <error message=\"{message}\"/>\n    \
             </testcase>\n  </testsuite>\n"
        );
    }
    xml + "</testsuites>\n"
}

/// The text as XML has it; characters that XML does not allow, however written, become U+FFFD.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&apos;",
            '\n' => escaped += "&#10;",
            '\t' => escaped += "&#9;",
            '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            c if c.is_control() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::Check;

    #[test]
    fn names_with_markup_and_control_characters_are_escaped() {
        let report = Report {
            file: "a<b>&\"'\u{1b}[31m.exr".into(),
            checks: vec![Check::at_most("<x>", "R", 2.0, 1.0, "at ]]>"), Check::at_most("y", "G", 0.0, 1.0, "")],
            skipped: vec!["channel \u{0}".into()],
            notes: vec!["a & b".into()],
            ..Report::default()
        };
        let text = xml(&[report], &[("z&".into(), Error::usage("bad <", "mend it"))]);
        assert!(text.contains("a&lt;b&gt;&amp;&quot;&apos;\u{fffd}[31m.exr"), "{text}");
        assert!(text.contains("tests=\"3\" failures=\"1\" errors=\"1\""), "{text}");
        assert!(!text.contains('\u{1b}') && !text.contains('\u{0}') && !text.contains("<x>"));
        // Every tag that opens closes, in order.
        let mut open = vec![];
        for tag in text.split('<').skip(2).map(|t| t.split('>').next().unwrap()) {
            if let Some(name) = tag.strip_prefix('/') {
                assert_eq!(open.pop(), Some(name));
            } else if !tag.ends_with('/') {
                open.push(tag.split(' ').next().unwrap());
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }
}
