//! `nanotap files`: what the files of instruments hold.

#[path = "../../../afm-files/tests/samples/mod.rs"]
pub(crate) mod samples;

use serde_json::json;

use crate::util::Folder;

#[test]
fn a_folder_is_listed_with_all_its_folders() {
    let folder = Folder::new();
    std::fs::create_dir_all(folder.path().join("day/one")).unwrap();
    folder.write("day/map.jpk-force-map", samples::zip(&samples::jpk_map()));
    // The content counts, not the name.
    folder.write("day/one/curve.dat", samples::bruker_curve());
    folder.write("day/one/notes.txt", "a note");
    folder.write("day/one/video.h5", b"\x89HDF\r\n\x1a\n");
    let listed = folder.run(&["files", "day", "--json"]).json();
    let files = listed["files"].as_array().unwrap();
    let names: Vec<&str> = files
        .iter()
        .map(|of| of["path"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "day/map.jpk-force-map",
            "day/one/curve.dat",
            "day/one/video.h5"
        ]
    );
    assert_eq!(listed["others"], 1);
    let map = &files[0];
    assert_eq!(map["format"], "jpk");
    assert_eq!(
        (&map["curve_count"], &map["grid"]),
        (&json!(2), &json!([2, 2]))
    );
    assert_eq!(map["spring_constant"], 0.04);
    assert_eq!(
        (&map["distance"], &map["distance_source"]),
        (&json!("measuredHeight"), &json!("measured"))
    );
    assert_eq!(map["segments"][1]["style"], "pause");
    assert_eq!(map["images"][0]["name"], "height retrace");
    assert_eq!(files[1]["distance_source"], "ramp");
    assert!(
        files[2]["error"]
            .as_str()
            .unwrap()
            .contains("HDF5, byte 0: 96 bytes are needed here"),
        "{}",
        files[2]
    );

    let text = folder.run(&["files", "day"]).stdout;
    for words in [
        "map.jpk-force-map",
        "approach, pause, retract",
        "40 mN/m",
        "50 nm/V",
        "1 other file of no known format",
    ] {
        let words: Vec<&str> = words.split_whitespace().collect();
        assert!(
            words.iter().all(|word| text.contains(word)),
            "{words:?} in {text}"
        );
    }
}

#[test]
fn a_curve_an_image_and_a_spectrum_are_drawn() {
    let folder = Folder::new();
    folder.write("a.nid", samples::nanosurf());
    for (item, words) in [
        (&[][..], "Deflection"),
        (&["--image", "0"], "Topography"),
        (&["--spectrum", "0"], "frequency"),
    ] {
        let arguments = [&["files", "a.nid", "--plot", "a.svg", "--force"], item].concat();
        let outcome = folder.run(&arguments);
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        assert!(folder.read("a.svg").contains(words), "{item:?}");
    }
    let missing = ["files", "a.nid", "--plot", "b.svg", "--curve", "7"];
    folder
        .run(&missing)
        .refused(&["no curve 7", "counted from 0"]);
    folder
        .run(&["files", "a.nid", "a.nid", "--plot", "b.svg"])
        .refused(&["one file"]);
    folder
        .run(&["files", "none.nid"])
        .refused(&["none.nid", "no such file"]);
}
