//! What a person should know of a chain, in sentences.

use super::Verdict;

/// The sentences.
pub(super) fn findings(verdict: &Verdict) -> Vec<String> {
    let mut found = vec![];
    if let Some(orientation) = &verdict.orientation {
        found.push(format!("orientation: {}", orientation.name));
        found.extend(orientation.faces.iter().map(|fault| fault.text.clone()));
    }
    let first = usize::from(verdict.against_itself);
    let judged = &verdict.levels[first..];
    match verdict.kernel {
        Some(kind) => found.push(format!("kernel: {}", kind.name())),
        None if judged.is_empty() => found.push("kernel: unknown; give what it was made from with --source".to_owned()),
        None if judged.iter().all(|level| level.roughness == Some(0.0)) => {
            found.push("kernel: none, mirrors only".to_owned())
        }
        None => found.push("kernel: unknown".to_owned()),
    }
    match verdict.scale {
        Some(scale) => found.push(format!("scale: {}", scale_name(scale))),
        None if judged.iter().any(|level| level.scale.is_some()) => {
            found.push("scale: not normalised, levels differ".to_owned());
        }
        None => found.push("scale: unknown".to_owned()),
    }
    for (m, level) in verdict.levels.iter().enumerate() {
        if level.nonfinite > 0 {
            found.push(format!("level {m}: {} values are not finite", level.nonfinite));
        }
        if level.negative > 0 {
            found.push(format!("level {m}: {} values are negative", level.negative));
        }
        let Some(error) = &level.error else { continue };
        if let Some((times, place)) = &error.worst_firefly {
            found.push(format!(
                "level {m}: {} fireflies, the worst {times:.3} times the truth at {place}",
                error.fireflies
            ));
        }
        if error.has_seams() {
            let [across, beside] = error.seams.map(|step| 100.0 * step);
            found.push(format!("level {m}: seams, jumps of {across:.2} % at edges, {beside:.2} % within faces"));
        }
    }
    found
}

/// What a factor is called.
fn scale_name(scale: f64) -> String {
    use std::f64::consts::PI;
    let near = |wanted: f64| (scale / wanted - 1.0).abs() < 0.03;
    match scale {
        _ if near(1.0) => "normalised".to_owned(),
        _ if near(PI) => format!("not normalised: multiplied by π ({scale:.4}), as irradiance E instead of E/π"),
        _ if near(1.0 / PI) => format!("not normalised: divided by π ({scale:.4})"),
        _ => format!("not normalised: {scale:.4} times the source ({:+.2} EV)", scale.log2()),
    }
}
