//! The page in one file, which opens from the disk.

use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use miniz_oxide::deflate::compress_to_vec;
use sha2::{Digest as _, Sha256};

use crate::page::replaced;
use crate::{WriteError, bundle};

/// The page.
pub(crate) const INDEX: &str = "index.html";
/// Level of the compression of modules.
const LEVEL: u8 = 10;
/// What the page loads that is in the one file.
const STYLE: &str = "<link rel=\"stylesheet\" href=\"./style.css\">\n";
const SCRIPT: &str = "<script type=\"module\" src=\"./main.js\"></script>\n";
const ICON: &str = "href=\"./icon.svg\"";
/// What begins and ends the page's policy.
const POLICY: &str = "<meta http-equiv=\"Content-Security-Policy\" content=\"";
const CLOSED: &str = "\">";
pub(crate) const END: &str = "</body>";

/// The page, with both modules.
pub(crate) fn page(
    texts: &BTreeMap<String, String>,
    fused: &[u8],
    exact: &[u8],
) -> Result<String, WriteError> {
    let text = |name: &str| texts.get(name).map_or("", String::as_str);
    let script = safe(&bundle::script(texts, "main.js")?);
    let style = text("style.css");
    let [of_script, of_style] = [&script, style].map(hash);
    let content = format!(
        "default-src 'none'; script-src '{of_script}' 'wasm-unsafe-eval' blob:; worker-src blob:; \
         style-src '{of_style}'; img-src data: blob:; base-uri 'none'; form-action 'none'"
    );
    let index = text("index.html");
    let own = index
        .split_once(POLICY)
        .and_then(|(_, rest)| rest.split_once(CLOSED));
    let (own, _) = own.ok_or_else(|| WriteError::Without(INDEX, POLICY.to_owned()))?;
    let icon = STANDARD.encode(text("icon.svg"));
    let mut page = index.to_owned();
    for (part, by) in [
        (own, content.as_str()),
        (STYLE, &format!("<style>{style}</style>\n")),
        (SCRIPT, ""),
        (ICON, &format!("href=\"data:image/svg+xml;base64,{icon}\"")),
    ] {
        page = replaced(INDEX, &page, part, by)?;
    }
    let part = |id: &str, kind: &str, text: &str| {
        format!("<script type=\"{kind}\" id=\"{id}\">{text}</script>\n")
    };
    let parts = [
        part("nanotap-worker", "text/plain", &safe(text("worker.js"))),
        part("nanotap-module", "application/octet-stream", &packed(fused)),
        part(
            "nanotap-module-exact",
            "application/octet-stream",
            &packed(exact),
        ),
        format!("<script>{script}</script>\n"),
        END.to_owned(),
    ];
    replaced(INDEX, &page, END, &parts.concat())
}

/// A script whose text does not end the element that it is in.
fn safe(script: &str) -> String {
    script.replace("</script", "<\\/script")
}

/// Bytes, deflated, in base64.
fn packed(bytes: &[u8]) -> String {
    STANDARD.encode(compress_to_vec(bytes, LEVEL))
}

/// The source of a policy that permits exactly this text.
fn hash(text: &str) -> String {
    format!(
        "sha256-{}",
        STANDARD.encode(Sha256::digest(text.as_bytes()))
    )
}
