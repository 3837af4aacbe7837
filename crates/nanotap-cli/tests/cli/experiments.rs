//! Studies of measurements at the terminal.

use crate::util::{Folder, case};

/// An NCHR-class lever of high Q on polystyrene, driven a little above its resonance.
const STIFF: &str = "\
[model]
modes = 2
[cantilever]
lever = \"PPP-NCHR\"
Q = 400
[tip]
radius = \"10 nm\"
[sample]
material = \"polystyrene\"
loss_tangent = 0.1
[drive]
frequency_ratio = 1.001
free_amplitude = \"20 nm\"
[gap]
tip = \"15 nm\"
";

#[test]
fn an_approach_curve_has_approach_and_retract() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    let json = folder
        .run(&[
            "approach",
            "lever.toml",
            "--from",
            "25 nm",
            "--to",
            "5 nm",
            "--points",
            "21",
            "--out",
            "curve.csv",
            "--plot",
            "curve.svg",
            "--json",
        ])
        .json();
    assert_eq!(json["path"].as_str(), Some("curve.csv"));
    let table = json["table"].as_array().unwrap();
    assert_eq!(table.len(), 42);
    let zc = |k: usize| table[k]["zc"].as_f64().unwrap();
    for (k, nm) in [(0, 25.0), (1, 24.0), (20, 5.0), (21, 5.0), (41, 25.0)] {
        assert!((zc(k) / (nm * 1e-9) - 1.0).abs() < 1e-9, "{}", zc(k));
    }
    // 22 nm is between the reach (20 nm) and the fold (23 nm): free on approach, tapping on
    // retract.
    let (there, back) = (&table[3], &table[38]);
    assert_eq!(there["way"], "approach");
    assert_eq!(there["physical"]["F_max"].as_f64(), Some(0.0));
    assert!(back["physical"]["A"].as_f64().unwrap() > 21e-9);
    assert_eq!(json["hysteresis"].as_array().unwrap().len(), 1);
    let folds = json["branches"]["bifurcations"].as_array().unwrap();
    assert!(folds.iter().any(|b| b["kind"] == "fold"));
    let csv = folder.read("curve.csv");
    assert_eq!(csv.lines().count(), 43);
    assert!(csv.starts_with("way,zc (m),") && csv.contains(",E_dis (eV),"));
    assert!(folder.read("curve.svg").contains("<svg"));
    let text = folder
        .run(&["approach", "lever.toml", "--points", "9"])
        .stdout;
    for words in ["hysteresis from", "fold", "retract", "eV"] {
        assert!(text.contains(words), "{words}:\n{text}");
    }
}

#[test]
fn frequency_modulation_is_a_command_with_the_curve_of_an_approach() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    let range = ["--from", "22 nm", "--to", "20.5 nm", "--points", "4"];
    let run = |first: &[&str], name: &str| {
        let [table, figure] = ["csv", "svg"].map(|ending| format!("{name}.{ending}"));
        let files = ["--out", &table, "--plot", &figure, "--threads", "1"];
        let said = folder.run(&[first, &["lever.toml"], &range, &files].concat());
        assert_eq!(said.code, 0, "{}", said.stderr);
        let [table, figure] = [table, figure].map(|path| {
            let path = folder.path().join(path);
            std::fs::read_to_string(path).unwrap()
        });
        (said.stdout, table, figure)
    };
    let fm = run(&["fm"], "fm");
    assert_eq!(fm, run(&["approach", "--fm"], "approach"));
    assert!(fm.0.contains("first order"), "{}", fm.0);
}

#[test]
fn invalid_approach_requests_are_refused() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    let run = |arguments: &[&str]| folder.run(&[&["approach", "lever.toml"], arguments].concat());
    run(&["--from", "5 nm", "--to", "20 nm"]).refused(&["from far to near"]);
    run(&["--points", "1"]).refused(&["--points 1", "from 2 to"]);
    run(&["--from", "20 kHz"]).refused(&["--from 20 kHz", "length", "frequency"]);
    run(&["--out", "curve.xlsx"]).refused(&["curve.xlsx", ".csv"]);
    case(STIFF, &["--set", "gap.tip=15 kHz"]).refused(&["gap.tip", "length"]);
}

/// The same lever without a distance: the setpoint determines it.
fn at_setpoint(setpoint: &str) -> String {
    STIFF.replace(
        "[gap]\ntip = \"15 nm\"\n",
        &format!("setpoint = \"{setpoint}\"\n"),
    )
}

#[test]
fn a_setpoint_serves_every_command() {
    let folder = Folder::new();
    folder.write("lever.toml", at_setpoint("16 nm"));
    let case = folder.run(&["case", "lever.toml", "--json"]);
    assert!(
        case.stderr
            .contains("reached on approach at gap.tip = 15.2 nm"),
        "{}",
        case.stderr
    );
    let json = case.json();
    let zc = json["setpoint_solved"]["solutions"][0]["zc"]
        .as_f64()
        .unwrap();
    assert_eq!(json["physical"]["tip_gap"].as_f64(), Some(zc));
    let orbit = folder.run(&["orbit", "lever.toml", "--json"]).json();
    let amplitude = orbit["physical"]["A"].as_f64().unwrap();
    assert!((amplitude / 16e-9 - 1.0).abs() < 1e-9, "{amplitude}");
    let text = folder.run(&["case", "lever.toml"]).stdout;
    assert!(text.contains("stable, reached on approach"), "{text}");
    // Too low to be reached: every command fails with the reason, except that the case is shown.
    folder.write("low.toml", at_setpoint("1 pm"));
    let failed = folder.run(&["orbit", "low.toml"]);
    assert_eq!(failed.code, 1);
    assert!(
        failed.stderr.contains("is not reached"),
        "{}",
        failed.stderr
    );
    let shown = folder.run(&["case", "low.toml"]);
    assert_eq!(shown.code, 1);
    assert!(shown.stderr.contains("is not reached"), "{}", shown.stderr);
    assert!(shown.stdout.contains("42 N/m"), "{}", shown.stdout);
}

#[test]
fn quantities_of_the_case_are_swept_in_their_units() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    let sweep = |over: &str, more: &[&str]| {
        folder.run(
            &[
                &[
                    "sweep",
                    "lever.toml",
                    "--over",
                    over,
                    "--periods",
                    "1",
                    "--json",
                ],
                more,
            ]
            .concat(),
        )
    };
    let json = sweep(
        "drive.frequency=328kHz:334kHz:7",
        &["--follow", "both", "--out", "f.csv", "--plot", "f.svg"],
    )
    .json();
    assert_eq!(json["runs"], 14);
    let csv = folder.read("f.csv");
    let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).unwrap();
    let (at, amplitude) = (column("drive.frequency (Hz)"), column("first_harmonic (m)"));
    let rows: Vec<Vec<f64>> = csv
        .lines()
        .skip(1)
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            vec![
                cells[at].parse().unwrap(),
                cells[amplitude].parse().unwrap(),
            ]
        })
        .collect();
    assert!(rows.iter().any(|r| r[0] == 328e3) && rows.iter().any(|r| r[0] == 334e3));
    // In metres: nanometres of a 20 nm drive.
    assert!(rows.iter().all(|r| r[1] > 0.5e-9 && r[1] < 40e-9));
    assert!(folder.read("f.svg").contains("drive frequency"));
    // Twice the drive at a large distance gives twice the amplitude.
    let json = sweep(
        "drive.amplitude=10pm:20pm:2",
        &["--set", "gap.tip=100 nm", "--out", "a.csv"],
    )
    .json();
    assert_eq!(json["counts"]["periodic"], 2);
    let csv = folder.read("a.csv");
    let column = csv
        .lines()
        .next()
        .unwrap()
        .split(',')
        .position(|h| h == "first_harmonic (m)");
    let values: Vec<f64> = csv
        .lines()
        .skip(1)
        .map(|l| l.split(',').nth(column.unwrap()).unwrap().parse().unwrap())
        .collect();
    assert!((values[1] / values[0] - 2.0).abs() < 1e-6, "{values:?}");
    sweep("drive.frequency=328nm:334nm:7", &[]).refused(&["expected a frequency", "a length"]);
    sweep("drive.frequenzy=328kHz:334kHz:7", &[]).refused(&["did you mean `drive.frequency`?"]);
    sweep("drive.frequency=328kHz:334nm:7", &[]).refused(&["expected a frequency"]);
    sweep("drive.frequency=328kilohertz:334kHz:7", &[]).refused(&["kilohertz"]);
}

#[test]
fn branches_run_over_quantities_of_the_case() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    let branch = |from: &str, to: &str, more: &[&str]| {
        let plain = [
            "branch",
            "lever.toml",
            "--parameter",
            "gap.tip",
            "--from",
            from,
            "--to",
            to,
        ];
        folder.run(&[&plain, more].concat())
    };
    let json = branch("24 nm", "10 nm", &["--json", "--plot", "b.svg"]).json();
    let folds: Vec<f64> = json["bifurcations"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|b| b["kind"] == "fold")
        .map(|b| b["parameter"].as_f64().unwrap())
        .collect();
    // The folds of docs/cases/approach-curve.md.
    assert!(
        (folds[0] - 19.974e-9).abs() < 1e-12 && (folds[1] - 23.170e-9).abs() < 1e-12,
        "{folds:?}"
    );
    let point = &json["points"][0];
    assert!(point["physical"]["A"].as_f64().unwrap() > 19e-9);
    assert!(folder.read("b.svg").contains("distance zc (nm)"));
    branch("24 nm", "10 kHz", &[]).refused(&["expected a length"]);
    branch("24", "10 nm", &[]).refused(&["24 m without a unit; did you mean 24 nm?"]);
    branch("24 Hz", "10 Hz", &[]).refused(&["gap.tip", "expected a length"]);
}

#[test]
fn the_window_reports_where_one_motion_exists() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    let plain = [
        "window",
        "lever.toml",
        "--over",
        "gap.tip=15nm:30nm:2",
        "--over",
        "drive.frequency=329.9kHz:331kHz:2",
        "--starts",
        "12",
        "--json",
    ];
    let json = folder
        .run(&[&plain, &["--plot", "w.svg"][..]].concat())
        .json();
    // Near the sample: one tapping motion at the resonance, in addition to the free one above it.
    // At large distances there is no contact.
    assert_eq!(
        json["conditions"],
        serde_json::json!([
            ["one-period-1", "no-contact"],
            ["second-state", "no-contact"]
        ])
    );
    assert_eq!(json["shares"]["no-contact"].as_f64(), Some(0.5));
    assert!(folder.read("w.svg").contains("a second state"));
    // It resumes where it stopped: all chunks exist.
    let again = folder.run(&plain);
    assert!(
        again.stderr.contains("chunks are there already"),
        "{}",
        again.stderr
    );
    assert_eq!(again.json()["conditions"], json["conditions"]);
    folder
        .run(&["window", "lever.toml", "--over", "gap.tip=15nm:30nm:2"])
        .refused(&["a window has two parameters, got 1", "twice"]);
}

/// An image of independent lines is a dataset that resumes; its report, figure and table are those
/// of the scan.
#[test]
fn an_image_is_a_dataset_that_resumes() {
    let folder = Folder::new();
    let image = include_str!("../../../../docs/cases/scan-particle.toml");
    folder.write(
        "image.toml",
        image.replace("periods = 5000", "periods = 500"),
    );
    let plain = ["scan", "image.toml", "--set", "scan.lines=6"];
    let with = |more: &[&str]| folder.run(&[&plain, more].concat());
    let scan = with(&["--json"]).json();
    with(&["--out", "image.zarr", "--chunk", "1/2", "--quiet"]);
    let whole = with(&["--out", "image.zarr", "--plot", "image.svg", "--json"]);
    let said = "image.zarr: 3 of 6 chunks are there already";
    assert!(whole.stderr.contains(said), "{}", whole.stderr);
    let whole = whole.json();
    for field in ["trace", "retrace", "lines", "loop", "verdict", "warnings"] {
        assert_eq!(whole[field], scan[field], "{field}");
    }
    assert!(folder.read("image.svg").contains("height"));
    let text = with(&["--out", "image.zarr"]).stdout;
    assert!(
        text.contains("image.zarr in") && text.contains("feedback loop"),
        "{text}"
    );
    with(&["--chunk", "1/2"]).refused(&["--chunk", "--out NAME.zarr"]);
    with(&["--set", "scan.line_settle=", "--out", "b.zarr"]).refused(&["--line-settle 2000"]);
}

/// Invalid levers and cases beyond the model's validity are reported with a remedy.
#[test]
fn impossible_levers_are_refused_and_touching_beams_warned_of() {
    let refused = |set: &str, words: &[&str]| {
        case(STIFF, &["--set", set]).refused(&[&[set], words].concat());
    };
    refused(
        "cantilever.k=42 kHz",
        &["a force per length", "a frequency"],
    );
    refused("cantilever.k=-1 N/m", &["above zero"]);
    refused("cantilever.Q=0", &["above zero"]);
    refused(
        "cantilever.f2=1 MHz",
        &["within a factor of two", "[[cantilever.mode]]"],
    );
    refused(
        "tip.mass=1 ug",
        &["must be below", "which a beam without mass would carry"],
    );
    refused("drive.frequency_ratio=nan", &["drive.frequency_ratio"]);
    refused("drive.setpoint=30 nm", &["below the free amplitude"]);
    refused("sample.poisson=0.7", &["not above 0.5"]);
    case(STIFF, &["--set", "sample.material=polystirene"])
        .refused(&["did you mean \"polystyrene\"?"]);
    // A tip 5 nm high indents a very soft sample until the beam touches it.
    let soft = STIFF.replace(
        "material = \"polystyrene\"\nloss_tangent = 0.1",
        "stiffness = \"0.01 N/m\"",
    );
    let shown = case(soft, &["--set", "tip.height=5 nm"]);
    assert_eq!(shown.code, 0);
    assert!(
        shown
            .stderr
            .contains("another part of the beam would touch"),
        "{}",
        shown.stderr
    );
}

/// Hertz's stiffness at an indentation depends on the product only: neither factor is printed as a
/// result, but the offset of the distance is.
#[test]
fn values_that_the_data_do_not_determine_are_in_brackets() {
    let folder = Folder::new();
    for (name, text) in [
        (
            "lever.toml",
            include_str!("../../../../docs/cases/stiff-lever.toml"),
        ),
        (
            "curve.csv",
            include_str!("../../../../docs/cases/polystyrene-curve.csv"),
        ),
    ] {
        folder.write(name, text);
    }
    let free = "sample.modulus,sample.indentation,gap.offset";
    let run = folder.run(&[
        "fit",
        "curve.csv",
        "lever.toml",
        "--free",
        free,
        "--no-profile",
    ]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let line = |name: &str| run.stdout.lines().find(|line| line.contains(name)).unwrap();
    for open in ["sample.modulus", "sample.indentation"] {
        let words: Vec<&str> = line(open).split_whitespace().collect();
        assert!(
            words[1].starts_with('(') && words[2].ends_with(')'),
            "{words:?}"
        );
        assert!(line(open).contains("not determined"));
    }
    assert!(!line("gap.offset").contains('('));
    assert!(run.stdout.contains("A value in brackets is no result"));
}

#[test]
fn unusable_data_and_parameters_are_refused_with_the_remedy() {
    let folder = Folder::new();
    folder.write("lever.toml", STIFF);
    folder.write("empty.csv", "");
    folder.write("curve.csv", "distance (nm),phase (deg)\n10,80\n11,81\n");
    folder.write("volts.csv", "ZSnsr (nm),Defl (V)\n10,0.8\n11,0.1\n");
    let fit = |data: &str, free: &str| folder.run(&["fit", data, "lever.toml", "--free", free]);
    let modulus = "sample.modulus";
    fit("none.csv", modulus).refused(&["none.csv: no such file"]);
    fit(".", modulus).refused(&[".: is a folder"]);
    fit("empty.csv", modulus).refused(&["empty.csv is empty"]);
    fit("volts.csv", modulus).refused(&["InvOLS", "--convert \"Defl=58 nm/V\""]);
    let slip = fit("curve.csv", "sample.modulsu");
    slip.refused(&[
        "--free: no parameter `sample.modulsu`",
        "did you mean `sample.modulus`?",
    ]);
    assert!(!slip.stderr.contains("drive.frequency"), "{}", slip.stderr);
    let unknown = fit("curve.csv", "sample.zzzzzzzzzzzz");
    unknown.refused(&["there are", "sample.modulus"]);
    assert!(!unknown.stderr.contains("tip.radius"), "{}", unknown.stderr);
    folder.write("none.csv", "mass (pg),colour\n1,2\n");
    fit("none.csv", modulus).refused(&["`mass`", "--convert \"mass=distance\""]);
    folder.write("none.csv", "distance (nm)\n1\n");
    fit("none.csv", modulus).refused(&["DATA: none.csv: no column is a measured quantity"]);
}

/// The law of Johnson, Kendall and Roberts does not hold at the modulus that the fit starts from,
/// but does at that of the soft sample.
#[test]
fn a_fit_warns_of_the_case_that_it_finds() {
    let folder = Folder::new();
    for (name, text) in [
        (
            "lever.toml",
            include_str!("../../../../docs/cases/force-curve-jkr.toml"),
        ),
        (
            "curve.csv",
            include_str!("../../../../docs/cases/silicone-force-curve.csv"),
        ),
    ] {
        folder.write(name, text);
    }
    let stiff = ["sample.modulus=1 GPa", "sample.work_of_adhesion=1 mJ/m^2"];
    let stiff = ["--set", stiff[0], "--set", stiff[1]];
    let warned = folder.run(&[&["case", "lever.toml"], &stiff[..]].concat());
    assert!(warned.stdout.contains("Tabor"), "{}", warned.stdout);
    let free = "sample.modulus,sample.work_of_adhesion,gap.offset,deflection.offset";
    let fit = [
        "fit",
        "curve.csv",
        "lever.toml",
        "--no-profile",
        "--free",
        free,
    ];
    let run = folder.run(&[&fit[..], &stiff].concat());
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(!run.stderr.contains("Tabor"), "{}", run.stderr);
}
