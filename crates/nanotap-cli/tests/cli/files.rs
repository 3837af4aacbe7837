//! Files that commands write or must not overwrite.

use crate::util::Folder;

/// Commands with the outputs that they can write.
const WRITERS: [&[&str]; 12] = [
    &["simulate", "--out", "a.csv", "--plot", "a.svg"],
    &[
        "simulate", "--method", "rk4", "--out", "b.csv", "--plot", "b.png",
    ],
    &[
        "orbit",
        "--period",
        "1",
        "--out",
        "c.csv",
        "--harmonics-out",
        "h.csv",
        "--plot",
        "c.pdf",
    ],
    &["attractors", "--starts", "4", "--out", "d.csv"],
    &["lyapunov", "--periods", "20", "--out", "e.csv"],
    &["modes", "--out", "f.csv"],
    &["convergence", "--out", "g.csv"],
    &[
        "branch",
        "--parameter",
        "omega",
        "--from",
        "3.6",
        "--to",
        "3.7",
        "--out",
        "i.csv",
    ],
    &["approach", "--points", "3", "--out", "j.csv"],
    &[
        "sweep",
        "--over",
        "omega=3.5:3.6:2",
        "--periods",
        "2",
        "--out",
        "k.csv",
    ],
    &[
        "basin",
        "--x",
        "a1=-1:1:2",
        "--y",
        "v1=-1:1:2",
        "--out",
        "l.csv",
    ],
    &["case", "--out", "m.toml"],
];

fn arguments_of<'a>(writer: &[&'a str]) -> Vec<&'a str> {
    [
        &writer[..1],
        &["case.toml", "--set", "omega=3.6", "-q"],
        &writer[1..],
    ]
    .concat()
}

/// The same command run twice may replace its own output, whatever the table.
#[test]
fn own_output_is_replaced() {
    let folder = Folder::with_paper_case();
    for writer in WRITERS {
        for _ in 0..2 {
            let outcome = folder.run(&arguments_of(writer));
            assert_eq!(outcome.code, 0, "{writer:?}: {}", outcome.stderr);
        }
    }
}

/// A case with comments, a foreign table, a picture: none is overwritten.
#[test]
fn foreign_files_are_replaced_only_with_force() {
    let folder = Folder::with_paper_case();
    folder.write("m.toml", "# my own case\n[model]\nmodes = 3\n");
    folder.write(
        "data.csv",
        "distance (nm),amplitude (nm),phase (deg)\n1,2,3\n",
    );
    folder.write("photo.png", b"\x89PNG\r\n\x1a\n of a cat");
    for arguments in [
        ["case", "case.toml", "--out", "m.toml"],
        ["case", "case.toml", "--out", "case.toml"],
        ["modes", "case.toml", "--out", "data.csv"],
        ["modes", "case.toml", "--plot", "photo.png"],
    ] {
        let before = std::fs::read(folder.path().join(arguments[3])).unwrap();
        let outcome = folder.run(&arguments);
        outcome.refused(&["was not written by nanotap", "--force", arguments[3]]);
        assert_eq!(
            std::fs::read(folder.path().join(arguments[3])).unwrap(),
            before
        );
    }
    for arguments in [
        ["modes", "case.toml", "--force", "--out", "data.csv"],
        ["case", "case.toml", "--force", "--out", "m.toml"],
    ] {
        assert_eq!(folder.run(&arguments).code, 0);
    }
    assert!(folder.read("data.csv").starts_with("xi,"));
    // A case that nanotap wrote and that has been edited since counts as foreign.
    assert_eq!(
        folder.run(&["case", "case.toml", "--out", "m.toml"]).code,
        0
    );
    let edited = folder.read("m.toml").replace("20.0", "21.0");
    folder.write("m.toml", edited);
    let outcome = folder.run(&["case", "case.toml", "--out", "m.toml"]);
    outcome.refused(&["was not written by nanotap"]);
    assert_eq!(folder.run(&["case", "m.toml"]).code, 0);
}

/// Commands that write many files check all of them first.
#[test]
fn foreign_files_in_a_folder_are_replaced_only_with_force() {
    let folder = Folder::with_paper_case();
    for (name, arguments) in [
        (
            "man/nanotap-orbit.1",
            &["generate", "man", "--out", "man"][..],
        ),
        (
            "here/report.html",
            &["paper", "--only", "eq23", "--out", "here"],
        ),
        (
            "here/fig4-mine.png",
            &["paper", "--only", "eq23", "--out", "here"],
        ),
    ] {
        let (inside, _) = name.split_once('/').unwrap();
        std::fs::create_dir_all(folder.path().join(inside)).unwrap();
        folder.write(name, "somebody's own");
        let outcome = folder.run(arguments);
        outcome.refused(&["was not written by nanotap", "--force", name]);
        let files = std::fs::read_dir(folder.path().join(inside)).unwrap();
        assert_eq!(files.count(), 1, "{name}");
        assert_eq!(folder.read(name), "somebody's own");
        // The second time the files are nanotap's.
        for force in [&["--force"][..], &[]] {
            let outcome = folder.run(&[arguments, force].concat());
            assert_eq!(outcome.code, 0, "{}", outcome.stderr);
            if name.ends_with("mine.png") {
                break;
            }
        }
        std::fs::remove_dir_all(folder.path().join(inside)).unwrap();
    }
}

#[test]
fn two_outputs_do_not_share_a_file() {
    let folder = Folder::with_paper_case();
    let arguments = [
        "orbit",
        "case.toml",
        "--period",
        "1",
        "--out",
        "x.csv",
        "--harmonics-out",
        "x.csv",
    ];
    folder.run(&arguments).refused(&["two outputs", "x.csv"]);
    assert_eq!(folder.names(), ["case.toml"]);
}

/// The same command twice at the same time on one dataset, and shares of it in parallel: each
/// finishes, and the bytes are those of a single run.
#[test]
fn two_processes_share_a_dataset() {
    let folder = Folder::with_paper_case();
    let sweep = |out: &str, share: &str| {
        let arguments = [
            "sweep",
            "case.toml",
            "--over",
            "omega=3.5:3.6:12",
            "--starts",
            "1",
            "--periods",
            "2",
            "--transient",
            "8",
            "-q",
            "--threads",
            "1",
            "--out",
            out,
            "--chunk",
            share,
        ];
        let mut command = folder.command(&arguments);
        command.stdout(std::process::Stdio::null());
        command.stderr(std::process::Stdio::piped());
        command
    };
    assert!(sweep("alone.zarr", "1/1").status().unwrap().success());
    let alone = super::sweeps::bytes(&folder.path().join("alone.zarr"));
    for round in 0..6 {
        let out = format!("round-{round}.zarr");
        let shares = if round % 2 == 0 {
            ["1/1", "1/1"]
        } else {
            ["1/2", "2/2"]
        };
        let children = shares.map(|share| sweep(&out, share).spawn().unwrap());
        for child in children {
            let output = child.wait_with_output().unwrap();
            let stderr = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "round {round}: {stderr}");
        }
        // The summary over all chunks, which neither share could compute.
        assert!(sweep(&out, "1/1").status().unwrap().success());
        assert!(
            alone == super::sweeps::bytes(&folder.path().join(out)),
            "round {round}"
        );
    }
}

/// Metadata that a power failure left empty or incomplete: `merge` reads them from the arrays, and
/// the same command writes them again.
#[test]
fn incomplete_metadata_are_rebuilt() {
    let folder = Folder::with_paper_case();
    let sweep = [
        "sweep",
        "case.toml",
        "--over",
        "omega=3.5:3.6:4",
        "-q",
        "--out",
        "s.zarr",
    ];
    assert_eq!(folder.run(&sweep).code, 0);
    let whole = folder.read("s.zarr/.zmetadata");
    for (round, torn) in ["", &whole[..whole.len() / 2]].into_iter().enumerate() {
        folder.write("s.zarr/.zmetadata", torn);
        let merged = format!("merged-{round}.zarr");
        let outcome = folder.run(&["merge", "s.zarr", "--out", &merged]);
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        assert_eq!(folder.run(&sweep).code, 0);
        assert_eq!(folder.read("s.zarr/.zmetadata"), whole);
    }
    // The source of the metadata is incomplete too: refused, with a remedy.
    folder.write("s.zarr/.zmetadata", "");
    folder.write("s.zarr/.zattrs", "{");
    let outcome = folder.run(&["merge", "s.zarr", "--out", "never.zarr"]);
    outcome.refused(&["empty or torn", "remove the folder"]);
    folder
        .run(&sweep)
        .refused(&["empty or torn", "remove the folder"]);
}

/// A foreign dataset can neither write elsewhere nor request all memory.
#[test]
fn merge_refuses_invalid_names_and_sizes() {
    let folder = Folder::with_paper_case();
    let sweep = [
        "sweep",
        "case.toml",
        "--over",
        "omega=3.5:3.6:4",
        "-q",
        "--out",
        "s.zarr",
    ];
    assert_eq!(folder.run(&sweep).code, 0);
    let whole = folder.read("s.zarr/.zmetadata");
    let variable = "tip_max";
    for name in ["../outside", "/tmp/outside", "..", "a/b", ".hidden"] {
        folder.write("s.zarr/.zmetadata", whole.replace(variable, name));
        let outcome = folder.run(&["merge", "s.zarr", "--out", "never.zarr"]);
        outcome.refused(&[name, "not a valid name of a variable"]);
        assert!(!folder.path().join("never.zarr").exists());
    }
    let long = whole.replace("[\\\"omega\\\",4,", "[\\\"omega\\\",4000000000000000000,");
    assert_ne!(long, whole);
    folder.write("s.zarr/.zmetadata", long);
    let outcome = folder.run(&["merge", "s.zarr", "--out", "never.zarr"]);
    outcome.refused(&["the sizes of"]);
}

/// A chaotic sweep, computed with and without vector registers: every file is the same to the last
/// bit. Without such registers both runs use the same code.
#[test]
fn every_arithmetic_gives_the_same_bytes() {
    let folder = Folder::with_paper_case();
    let sweep = |out: &str, path: &str| {
        let arguments = [
            "sweep",
            "case.toml",
            "--over",
            "omega=2.5:2.9:6",
            "--starts",
            "1",
            "--periods",
            "4",
            "--transient",
            "20",
            "-q",
            "--out",
            out,
        ];
        let mut command = folder.command(&arguments);
        command.env("NANOTAP_ARITHMETIC", path);
        assert!(command.output().unwrap().status.success());
        super::sweeps::bytes(&folder.path().join(out))
    };
    assert!(sweep("vectors.zarr", "") == sweep("plain.zarr", "plain"));
}

/// Chunks of another arithmetic are neither continued nor merged.
#[test]
fn arithmetics_are_not_mixed() {
    let folder = Folder::with_paper_case();
    let sweep = [
        "sweep",
        "case.toml",
        "--over",
        "omega=3.5:3.6:2",
        "-q",
        "--out",
    ];
    for out in ["a.zarr", "b.zarr"] {
        assert_eq!(folder.run(&[&sweep[..], &[out]].concat()).code, 0);
    }
    let other = folder
        .read("b.zarr/.zmetadata")
        .replace("\"arithmetic\": \"", "\"arithmetic\": \"another-");
    folder.write("b.zarr/.zmetadata", other);
    let merge = folder.run(&["merge", "a.zarr", "b.zarr", "--out", "never.zarr"]);
    merge.refused(&["are not shares of one dataset", "arithmetic", "another-"]);
    let again = folder.run(&[&sweep[..], &["b.zarr"]].concat());
    again.refused(&["belongs to another case", "arithmetic", "another-"]);
}

/// A device has no end: every file that a user, a case or a dataset names is refused if it is one.
#[cfg(unix)]
#[test]
fn devices_are_not_read() {
    let folder = Folder::with_paper_case();
    let zero = "/dev/zero";
    let case = include_str!("../../../../docs/cases/dmt-table.toml");
    folder.write("table.toml", case.replace("dmt-curve.csv", zero));
    let lever = include_str!("../../../../docs/cases/stiff-lever.toml");
    folder.write("lever.toml", lever);
    let scan = include_str!("../../../../docs/cases/scan-step.toml");
    let of_file = |key: &str| format!("{scan}\n{key} = \"{zero}\"\nimage_height = \"1 nm\"\n");
    folder.write("image.toml", of_file("image"));
    let slice = ["--x", "a1=-1:1:2", "--y", "v1=-1:1:2"];
    let commands: [&[&str]; 8] = [
        &["case", zero],
        &["case", "table.toml"],
        &["case", "table.toml", "--set", "sample.table=/dev/zero"],
        &["fit", zero, "lever.toml", "--free", "sample.modulus"],
        &["reconstruct", zero, "lever.toml"],
        &["catalogue", "--catalogue", zero],
        &["scan", "image.toml"],
        &[&["basin", "case.toml", "--attractors", zero][..], &slice].concat(),
    ];
    for command in commands {
        folder
            .run(command)
            .refused(&["/dev/zero", "is not a regular file"]);
    }
    std::fs::create_dir(folder.path().join("a.zarr")).unwrap();
    std::os::unix::fs::symlink(zero, folder.path().join("a.zarr/.zmetadata")).unwrap();
    let merged = folder.run(&["merge", "a.zarr", "--out", "b.zarr"]);
    assert_eq!(merged.code, 1, "{}", merged.stderr);
    assert!(
        merged.stderr.contains("is not a regular file"),
        "{}",
        merged.stderr
    );
}
