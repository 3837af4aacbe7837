//! Requests of the explorer's page, mutated, and bytes that are no requests.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

use crate::mutation::{self, Random};
use crate::program;
use crate::seeds;
use crate::util::Folder;

/// Requests; each has so long for its answer.
const REQUESTS: usize = 1500;
const PATIENCE: Duration = Duration::from_millis(60);

/// A running explorer.
struct Explorer {
    child: Child,
    port: String,
    token: String,
}

impl Explorer {
    fn start(folder: &Folder) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_nanotap"))
            .args(["explore", "--no-browser"])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(folder.path().join("stderr")).unwrap())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        out.read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("http://127.0.0.1:").unwrap();
        let (port, token) = address.split_once("/?token=").unwrap();
        Self {
            child,
            port: port.to_owned(),
            token: token.to_owned(),
        }
    }

    /// The beginning of the answer to some bytes; empty if there is none in time.
    fn answer(&self, request: &[u8], patience: Duration) -> String {
        let mut stream = TcpStream::connect(format!("127.0.0.1:{}", self.port)).unwrap();
        stream.set_read_timeout(Some(patience)).unwrap();
        // It may close the connection before it has read everything.
        let _ = stream.write_all(request);
        let mut answer = [0; 4096];
        let count = stream.read(&mut answer).unwrap_or(0);
        String::from_utf8_lossy(&answer[..count]).into_owned()
    }

    fn post(&self, path: &str, body: &str) -> Vec<u8> {
        format!(
            "POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nx-nanotap-token: {}\r\n\
             content-type: application/json\r\ncontent-length: {}\r\nconnection: close\r\n\r\n{body}",
            self.port,
            self.token,
            body.len()
        )
        .into_bytes()
    }

    fn about(&self) -> Vec<u8> {
        let request = self.post("/api/about", "");
        let text = String::from_utf8(request).unwrap();
        text.replacen("POST", "GET", 1).into_bytes()
    }
}

/// Bodies that are answered, by their address.
fn bodies() -> Vec<(&'static str, Value)> {
    let case = json!({"preset": "paper", "set": ["omega=2.7"]});
    let study = |tab: &str, options: Value| json!({"case": case, "tab": tab, "options": options});
    let range = json!({"key": "omega", "from": "2.9", "to": "3.1"});
    let plane = json!({
        "key1": "omega", "from1": "2.5", "to1": "2.6", "key2": "alpha1", "from2": "0.09", "to2": "0.1"
    });
    vec![
        (
            "/api/motion",
            json!({"case": case, "start": "", "ranges": true, "steps": 10, "views": []}),
        ),
        (
            "/api/motion",
            json!({"case": case, "start": "0.1,0,0,0,0,0", "from": case}),
        ),
        (
            "/api/law",
            json!({"case": {"preset": "stiff-lever"}, "set": ["sample.law=dmt"]}),
        ),
        (
            "/api/force",
            json!({"case": {"preset": "stiff-lever", "set": ["sample.law=dmt"]}, "force": "4/3*E*max(-d, 0)^1.5*sqrt(R) - c*v",
                "parameters": {"c": "1e-9 N s/m"}, "take": true}),
        ),
        ("/api/attractors", json!({"case": case})),
        ("/api/study", study("resonance", range.clone())),
        ("/api/study", study("diagram", range)),
        ("/api/study", study("map", plane)),
        (
            "/api/study",
            json!({"case": case, "tab": "fit", "options": {}, "data": ["x.csv", "distance (nm),amplitude (nm)\n1,2\n"]}),
        ),
        (
            "/api/figure",
            json!({"case": case, "kind": "svg", "views": []}),
        ),
        ("/api/export", json!({"case": case, "format": "csv"})),
        ("/api/export", json!({"case": case, "format": "toml"})),
    ]
}

#[test]
fn requests() {
    let folder = Folder::new();
    let mut explorer = Explorer::start(&folder);
    let bodies = bodies();
    for seed in seeds(REQUESTS) {
        let random = &mut Random::new(seed);
        let (path, body) = &bodies[random.below(bodies.len())];
        let mut body = body.clone();
        for _ in 0..random.below(3) {
            mutation::json(random, &mut body);
        }
        let mut request = explorer.post(path, &body.to_string());
        if random.rarely(4) {
            mutation::bytes(random, &mut request);
        }
        let answer = explorer.answer(&request, PATIENCE);
        assert!(
            !answer.starts_with("HTTP/1.1 500") && !answer.contains("please report"),
            "{path} {body}: {answer}"
        );
    }
    let alive = explorer.answer(&explorer.about(), Duration::from_secs(60));
    assert!(alive.starts_with("HTTP/1.1 200"), "{alive}");
    program::interrupt(&explorer.child);
    let status = explorer.child.wait().unwrap();
    let wrong = program::wrong(&folder, "explore", status, true);
    assert_eq!(wrong, None);
}

/// Two values of a header that decides who is answered are refused, as is a target that names another
/// host.
#[test]
fn ambiguous_requests() {
    let folder = Folder::new();
    let mut explorer = Explorer::start(&folder);
    let (port, token) = (&explorer.port, &explorer.token);
    let get = |target: &str, headers: &str| {
        format!("GET {target} HTTP/1.1\r\n{headers}connection: close\r\n\r\n").into_bytes()
    };
    let own = format!("Host: 127.0.0.1:{port}\r\n");
    let key = format!("x-nanotap-token: {token}\r\n");
    let other = "Host: example.org\r\n";
    let path = "/api/about";
    let elsewhere = format!("http://example.org{path}");
    let here = format!("http://127.0.0.1:{port}{path}");
    for (request, status) in [
        (get(path, &format!("{own}{key}")), 200),
        (get(&here, &format!("{own}{key}")), 200),
        (get(path, &format!("{own}{other}{key}")), 400),
        (get(path, &format!("{other}{own}{key}")), 400),
        (get(path, &format!("{own}{own}{key}")), 400),
        (get(path, &format!("{own}{key}{key}")), 400),
        (get(path, &key), 421),
        (get(path, &format!("{other}{key}")), 421),
        (get(&elsewhere, &format!("{own}{key}")), 421),
    ] {
        let answer = explorer.answer(&request, Duration::from_secs(60));
        let expected = format!("HTTP/1.1 {status}");
        let asked = String::from_utf8_lossy(&request);
        assert!(answer.starts_with(&expected), "{asked}: {answer}");
    }
    program::interrupt(&explorer.child);
    explorer.child.wait().unwrap();
}

/// Another user reads command lines in `/proc`: the opener of the browser gets a page, which only the
/// owner may read, and nothing of the program's is in a folder that others may enter.
#[test]
fn the_token_is_on_no_command_line() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = Folder::new();
    let temporary = folder.path().join("tmp");
    std::fs::create_dir(&temporary).unwrap();
    // The program that opens the browser writes down what it was called with, and keeps the page.
    folder.write(
        "xdg-open",
        "#!/bin/sh\ncp -p \"$1\" page\necho \"$@\" > words.part\nmv words.part words\n",
    );
    let opener = folder.path().join("xdg-open");
    std::fs::set_permissions(&opener, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!(
        "{}:{}",
        folder.path().display(),
        std::env::var("PATH").unwrap_or_default()
    );
    let mut child = Command::new(env!("CARGO_BIN_EXE_nanotap"))
        .args(["explore"])
        .current_dir(folder.path())
        .env("PATH", path)
        .env("TMPDIR", &temporary)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    out.read_line(&mut line).unwrap();
    let token = line.trim().split_once("token=").unwrap().1;
    let mode =
        |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    let words = (0..3000).find_map(|_| {
        std::thread::sleep(Duration::from_millis(10));
        std::fs::read_to_string(folder.path().join("words")).ok()
    });
    let words = words.expect("xdg-open was not called");
    assert!(!words.contains(token), "{words}");
    let page = std::path::Path::new(words.trim());
    assert!(page.starts_with(&temporary), "{words}");
    assert_eq!((mode(page), mode(page.parent().unwrap())), (0o600, 0o700));
    assert!(folder.read("page").contains(line.trim()));
    // A name that cannot be predicted: 128 random bits.
    let name = page.parent().unwrap().file_name().unwrap();
    assert_eq!(name.to_string_lossy().len(), "nanotap-explorer-".len() + 32);
    program::interrupt(&child);
    child.wait().unwrap();
    assert_eq!(std::fs::read_dir(&temporary).unwrap().count(), 0);
}
