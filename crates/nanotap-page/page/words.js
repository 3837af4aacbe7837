// The page's words, in one language each. A quantity, a key and an option of a study have the words of the
// program's own tables; these are the page's own. `{name}` is replaced by a value.

import { german } from "./words-de.js";

const english = {
  title: "nanotap: what a tapping lever does",
  lead: "What can a tapping AFM lever do on your sample? Every motion, worked out in this browser.",
  skip: "Skip to the states",
  parts: "Parts of the page",
  example: "Example",
  openFile: "Open a case file …",
  openLabel: "Case file, and the files that it names",
  groups: { "Your case": "My case", Levers: "Examples with units", "Numbers of the equations": "Examples without units" },
  presets: {
    dmt: "Stiff sample that sticks, in air", bistable: "Two states (the classic)", "stiff-lever": "Stiff lever near resonance", "fm-lever": "Medium lever on polystyrene", "two-modes": "Two modes of one lever",
    hertz: "Stiff sample that does not stick", "soft-sample": "Soft sample", capillary: "Humid air: a water bridge", liquid: "Gel in a liquid", patch: "Flat, but the image shows a step",
    paper: "The paper: regular", "paper-chaos": "The paper: chaotic", "paper-fast": "The paper: periods 1 and 4", impact: "A ball against a wall",
  },
  opened: "Opened files",
  undo: "Undo",
  reset: "Back to the example",
  share: "Copy link",
  takeBack: "Take back",
  close: "Close",
  otherLanguage: "Deutsch",
  views: { states: "States", plan: "Plan", scan: "Scan", data: "My data", studies: "Further studies" },
  lecture: "Lecture",
  fromLink: { newer: "This link is of another version of nanotap, and this one cannot read its case.", damaged: "This link is damaged: it contains no case file.", refused: "The case of this link is refused: {reason}.", first: "The page shows its first example.", unknown: "This link begins with an example that nanotap {version} does not have ({name})." },
  set: {
    heading: "What you set",
    setpoint: "Setpoint",
    setpointHint: "{amplitude} of {free} free amplitude",
    distance: "Distance",
    distanceHint: "between tip and sample at rest",
    hold: "What is held",
    holdSetpoint: "hold the setpoint",
    holdDistance: "hold the distance",
    free: "Free amplitude",
    freeHint: "far from the sample; driven at {frequency}",
    lever: "My lever",
    ownLever: "my own values",
    leverHint: "{k} · {f0} · Q {q} · tip {radius}",
    sample: "My sample",
    short: { "sample.modulus": "modulus", "sample.stiffness": "stiffness", "sample.hamaker": "Hamaker constant", "sample.work_of_adhesion": "work of adhesion", "sample.adhesion_force": "adhesion force" },
    ownSample: "my own values",
    law: "Tip and sample",
    addForce: "+ another force",
    addForceHint: "The forces add up.",
    otherLaw: "sum of laws: {laws}",
    all: "All {count} values",
    save: "Save the case",
    huge: "{typed} means {value} here, {times} times the former value.",
    keepIt: "Keep {value}",
    inUnit: "{value} instead",
    setpointWrong: "A setpoint is a part of the free amplitude (80 %, 0.8) or a length below it (16 nm).",
  },
  formula: {
    label: "Force as a formula of the gap d and its rate v",
    missing: "{name} has no value yet:",
    example: "e.g. 2 GPa",
    stays: "Until it is right, the states are those of the last right formula.",
    select: "Select it in the formula",
    curve: "The force over the gap",
    gap: "gap d (nm)",
    ends: "Vertical lines: the branches end at {ends}.",
    memory: "The curve is the force while the memory is zero.",
    ways: "Solid: approaching, dashed: withdrawing, each at {speed}.",
    help: "What a formula may contain",
    language: [
      "d is the gap (negative when the tip indents the sample), v its rate of change; a positive force pushes the tip away.",
      "R, E, nu, H and a0 are the values of tip and sample. Every other name is a parameter of your own.",
      "+ − * / ^, sqrt, cbrt, exp, ln, sin, cos, tan, atan, sinh, cosh, tanh, abs, min, max, step, pi.",
      "if d < 0 then … else …; “turned” is true once the tip withdraws in contact. A definition ends with a semicolon: x = d/a; k*x.",
      "s' = (F/ks - s)/tau; before the force is a memory that the force F drives, such as a surface that gives way: the gap to it is d + s.",
    ],
  },
  /** Families of laws, and the words for each law; its formula and its name in the file are next to it. */
  families: {
    elastic: "Elastic", sticky: "Sticky", wet: "In water, in humid air", slow: "Polymer, gel, cell", electric: "Electric", measured: "Measured, or my own formula",
  },
  laws: {
    hertz: "elastic sample, sphere", cone: "elastic sample, cone", punch: "elastic sample, flat punch",
    "thin-sphere": "thin film, sphere", "thin-cone": "thin film, cone", "thin-punch": "thin film, flat punch",
    "layer-sphere": "film of known thickness, sphere", "layer-cone": "film of known thickness, cone", "layer-punch": "film of known thickness, flat punch",
    "spring-damper": "plain spring and damper",
    dmt: "sticks, stiff (DMT)", jkr: "sticks, soft (JKR)", "adhesion-hysteresis": "sticks more on the way out",
    "van-der-waals": "attraction only, sphere", "van-der-waals-cone": "attraction only, cone", "van-der-waals-punch": "attraction only, flat punch", "sphere-cone": "attraction only, cone with a round end", "lennard-jones": "atoms (Lennard-Jones)",
    morse: "last atoms: a bond (Morse)", "pair-lennard-jones": "last atoms: a pair (Lennard-Jones)", "inverse-power": "attraction only, power of the distance",
    capillary: "water bridge", dlvo: "charges in an electrolyte (DLVO)", solvation: "layers of molecules",
    "kelvin-voigt": "recovers by itself: spring and damper", "moving-surface": "recovers by itself and sticks", "standard-linear-solid": "one relaxation time", "generalised-maxwell": "many relaxation times: springs",
    "prony-sphere": "many relaxation times, sphere", "prony-cone": "many relaxation times, cone", "prony-punch": "many relaxation times, flat punch",
    "voigt-sphere": "viscoelastic, sphere", "voigt-sphere-pulling": "viscoelastic and pulling, sphere", "voigt-cone": "viscoelastic, cone", "voigt-cone-pulling": "viscoelastic and pulling, cone", "voigt-punch": "viscoelastic, flat punch", "voigt-punch-pulling": "viscoelastic and pulling, flat punch",
    "viscous-contact": "damping only, in contact", "exponential-damping": "damping only, decays with the gap", "power-damping": "damping only, power of the gap",
    electrostatic: "voltage", "electrostatic-ac": "with ac voltage (KPFM)", coulomb: "two charges (Coulomb)",
    table: "my force curve", formula: "my own formula",
  },
  states: {
    heading: "States at this setpoint: {count}",
    headingDistance: "States at this distance: {count}",
    headingSearch: "States: looking for them",
    counts: ["none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"],
    unstable: "with the unstable ones",
    pause: "Pause",
    play: "Play",
    heads: { state: "State", film: "Moving lever", distance: "Distance", amplitude: "Amplitude", phase: "Phase lag", force: "Peak force", indentation: "Indents", energy: "Energy lost", how: "How you get there", jump: "Until it jumps", compare: "Compare" },
    compareWith: "{name}: compare with the chosen state",
    compared: "{one} and {other}, side by side",
    difference: "Difference",
    filmAbout: "The tip over the sample: its whole swing, and the lowest part magnified. Dotted: the lowest point.",
    names: { free: "Free", attractive: "Attractive", repulsive: "Repulsive", unstable: "Unstable", chaotic: "Chaotic", "quasi-periodic": "Quasi-periodic", undecided: "Undecided" },
    about: { free: "does not feel the sample", away: "stays off the surface", taps: "taps the surface", between: "between them", unstable: "never reached by itself" },
    period: "every {period} drive periods",
    chosen: "The chosen state, and the setpoint",
    noEnergy: "No state loses energy in the sample.",
    how: {
      afar: "coming from afar",
      back: "press, then draw back",
      rest: "switch the drive on here",
      knock: "a knock from the other state",
      start: "from {share} % of the starts searched",
      never: "not by itself",
      looking: "…",
    },
    jump: {
      between: "holds from {low} to {high}",
      down: "holds down to {low}",
      knock: "a knock of {speed}, {share} % of the tip’s own speed: the smallest found",
      noKnock: "no knock up to {speed} upsets it",
      margin: "{name} state, at this distance:",
      marginHeld: "{name} state, while the feedback holds {kind} of {value}:",
      kinds: { amplitude: "an amplitude", "peak force": "a peak force", phase: "a phase lag" },
      atDistance: "At this distance:",
      frequency: "drive frequency {range}, at this strength of the drive",
      free: "free amplitude {range}",
      range: "from {low} to {high}", least: "down to {low}", most: "up to {high}",
      grows: "a deviation grows e-fold in {periods} periods",
      settlesPeriods: "a disturbance falls to 1/e in {periods} periods",
    },
    held: { setpoint: "setpoint", distance: "distance" },
    sentence: {
      none: "No state was found here. {reason}",
      one: "The lever is in the {name} state{touch}.",
      only: "No other stable state was found at this {held}.",
      afar: "Coming from afar you get the {name} state{touch}.",
      other: "If the lever switches to the {name} one{touch}, {change}.",
      step: "the image shows a step of {step}",
      phaseUp: "the phase rises by {degrees}",
      phaseDown: "the phase falls by {degrees}",
      flat: "although the surface is flat",
      touchNot: ", which does not touch",
      presses: ", which presses with {force}",
      single: "One stable motion was found at this {held}.",
      many: "There are {count} stable motions at this {held}.",
      and: " and ",
    },
    lost: "{name} state lost: the lever jumps.",
    approximate: "≈ read off the curve; exact in a moment",
    searching: "searching from many starts …",
    searched: "Searched from {starts} starts{place}: with 95 % confidence fewer than {unseen} leads to a state that is not listed.",
    searchedNo: "Searched from {starts} starts{place}.",
    searchedAt: " at {distance}",
    oneIn: "1 in {count}",
    undecided: "{count} of them stay undecided.",
    unbounded: "{count} of them fly away.",
    searchedMore: "In addition to these branches the search found: {motions}.",
    ofFormer: "of the former values",
    curve: "Where the states lie",
    curveLooking: "following the states along the distance …",
    curveFollowed: "A click sets the {held} there.",
    scope: "Oscilloscope: {name} state",
    scopeChoose: "Choose a state.",
    axes: { distance: "distance $z$", phase: "phase lag", amplitude: "amplitude $A$", height: "height", force: "force", time: "time (drive periods)" },
    more: "More of this state",
    stable: "stable",
    notStable: "unstable",
    here: "this state",
    rowLabel: "{name}: choose this state",
    surface: "surface",
  },
  fields: {
    hints: {},
    choices: {},
    of: {
      simulate: {
        drive_signal: { words: "signal" }, state: { words: "initial state" },
        periods: { words: "drive periods after it", about: "Drive periods for which the lever is followed after the end of the signal" },
      },
      "image-states": {
        setpoint: { words: "Setpoint of the image", hint: "of the case" }, phase_offset: { words: "Phase at a lag of zero (°)", hint: "from the image" }, sense: { words: "The phase is a", choices: { "": "from the image" } }, direction: { words: "Lines of the" },
        convert: { words: "Conversions", hint: "NAME=RULE" }, height: { words: "Channel of the height", hint: "by its name" }, amplitude: { words: "Channel of the amplitude", hint: "by its name" }, phase: { words: "Channel of the phase", hint: "by its name" },
        amplitude_noise: { words: "Noise of the amplitude", hint: "from the image" }, phase_noise: { words: "Noise of the phase (°)", hint: "from the image" }, phase_tolerance: { words: "Error of the case's phases (°)" },
        amplitude_error: { words: "Correct the error of the amplitude, too" }, confidence: { words: "Least probability" },
      },
    },
  },
  cards: {
    approach: "Come near, draw back", diagram: "Period doubling", branches: "All motions", resonance: "Resonance", basin: "Which start leads where", map: "Map", plan: "Where you may work", levers: "Which lever", image: "Scan", data: "My data", simulate: "A pulse, a chirp, a sinc",
  },
  data: {
    image: {
      ask: "Which state is my image in?", askAbout: "The lever's state in each pixel, the steps of the height that are the lever's, and the heights without them",
      again: "Compute", curve: "Show the curve",
      states: { attractive: "attractive", repulsive: "repulsive", free: "free flight", undecided: "undecided" },
      decided: "Shares of the pixels: {shares}.",
      share: "{share} {name}",
      undecided: "The image does not tell in which state it was taken.",
      noStep: "The state does not change along a line: no step of the height is the lever's.",
      oneStep: "The state changes once: this step of the height is the lever's, not the surface's ({height} at the most).",
      manySteps: "The state changes {count} times: these steps of the height are the lever's, not the surface's ({height} at the most).",
      reference: "The corrected heights are those of the {name} state.",
      below: "below 1 %",
      statesHead: "States of the lever at the setpoint",
      stepsHead: "Steps of the height that are the lever's",
      stepsFirst: "Steps of the height that are the lever's, {shown} of {count}",
      heads: { state: "state", share: "part of the image", phase: "phase lag", measured: "phase in the image", distance: "distance", height: "adds to the height", force: "peak force", line: "line", x: "position", pixel: "pixel", change: "change", step: "step in the image" },
      figure: { "height $z$": "height $z$", "corrected height": "corrected height", "position $x$": "position $x$", "position $y$": "position $y$", phase: "phase", measured: "measured", corrected: "corrected", undecided: "undecided", attractive: "attractive", repulsive: "repulsive", free: "free flight" },
      files: { pixels: "States of the pixels (CSV)", corrected: "Corrected heights (GSF)" },
    },
    file: "your file", fit: "Find the values", force: "Force from the data alone", forceAbout: "Conservative force and dissipation against distance from the curve, without a contact law", calibrate: "Calibrate the lever", calibrateAbout: "Spring constant, resonance, Q and sensitivity from thermal noise: a spectrum, or a record of the lever at rest", example: "Try an example", drop: "Your curve over all states of the lever, the values that fit it, and the force without a law. A thermal spectrum or a record of noise calibrates the lever: spring constant, Q and sensitivity. Images of height, amplitude and phase tell in which state each pixel was taken. Drop a file of your instrument (JPK, Bruker, Asylum, Nanosurf …) or a CSV file here; its columns are named as in “distance (nm)”, “phase (deg)”. The file stays on this device.",
  },
  plan: {
    heading: "Plan an experiment",
    lever: "My lever is {lever}, my sample is {sample}.",
    wish: "I may press with {force} nN at most, and I want {want}.",
    line: "One line has {points} points, the steps are at most {step} nm.",
    labels: { lever: "My lever", sample: "My sample", force: "Largest force, nN", want: "What I want", points: "Points of a line", step: "Highest step, nm" },
    wants: { one: "only one state", any: "any that is gentle enough", tap: "to tap", away: "not to touch" },
    ownLever: "my own: {k}, {f0}, Q {q}",
    noLever: "I have no lever yet",
    ownSample: "my own values",
    ownModulus: "my own: {modulus}",
    forceWrong: "How many nN? Type a force such as 1.6. Without a unit it is nN.",
    stepWrong: "How high are the steps? Type a height such as 10. Without a unit it is nm.",
    looking: "Looking near free amplitude and setpoint of the case …",
    found: "Free amplitude {free}, setpoint {setpoint}",
    chosen: "Chosen on the map: it does not meet your wishes.",
    soFar: "So far: {known} of {of} points. {progress}",
    complete: "All {of} points are known.",
    former: "of the former values",
    one: "Coming from afar, the lever reaches this setpoint at {distance}, where only one stable state was found{there}, so that the image cannot switch. {press} ",
    several: "Coming from afar, the lever reaches this setpoint at {distance}, where {count} stable states were found: the image may switch between them. {press} ",
    regime: ", the {regime} one",
    press: {
      with: "It presses with {force}, {allowed}.",
      withAll: "The hardest one presses with {force}, {allowed}.",
      not: "The tip does not touch the sample.",
      notAll: "No state touches the sample.",
    },
    below: "within your {limit}",
    above: "more than your {limit}",
    lines: "Up to {rate} lines a second, {limit}",
    limits: {
      lever: "if every point gets one time constant of the lever ({time}).",
      gain: "if the feedback is to follow a step of {step} within a point: the gain, {gain}/s, takes {time} for it.",
      slew: "if the feedback is to follow a step of {step} within a point: the slew rate takes {time} for it.",
    },
    usualGain: "The case states no gain: this is half the rate at which the lever follows.",
    others: "Also possible",
    heads: { free: "free amplitude", setpoint: "setpoint", states: "states", force: "presses with", lines: "lines a second" },
    counts: ["none", "one", "two", "three", "four"],
    notebook: "One line for the notebook",
    copy: "Copy",
    copied: "Copied",
    notCopied: "Select the line and copy it.",
    show: "Show these states",
    window: "Where you may work",
    windowWords: "A click on a tile shows its states, force and line. Empty: not yet known.",
    none: "Nothing here meets your wishes",
    noneSoFar: "Nothing yet meets your wishes",
    fails: {
      force: "No state stays below {limit}.",
      kind: "The wish “{want}” is met nowhere.",
      both: "“{want}” and at most {limit} are not met together.",
    },
    gentlest: "The gentlest with “{want}” presses with {force} (free amplitude {free}, setpoint {setpoint}).",
    gentle: "Below {limit} the nearest has {states} ({force} at free amplitude {free}, setpoint {setpoint}).",
    statesOf: { 1: "one state", 2: "two states", 3: "three states", 4: "four states" },
    whichLever: "Which lever would do?",
    levers: "Levers on this sample, best first",
    leversLooking: "Looking at the levers of the catalogue … {progress}",
    leversTake: "A tap takes a lever.",
    leverDoes: "The {lever} would do: it presses with {force}.",
    leverTouchesNot: "The {lever} would do: it does not press on the sample.",
    leverNone: "No lever of the catalogue would do at this free amplitude and setpoint.",
    leverHeads: { lever: "lever", k: "stiffness", f: "resonance", tip: "tip radius", force: "presses with", regime: "state", states: "states", line: "256 points, there and back, take", fits: "fits your wishes?" },
  },
  motion: {
    parameters: "Parameters of the case", guide: "Guided start", closeGuide: "Close the guided start",
    bench: "Parameter studies",
    tabs: "Studies",
    lever: "Lever and sample in slow motion",
    clock: "drive period {period} of {periods}, phase {phase}°",
    scale: "height shown: {scale}; length not to scale",
    contact: "contact",
    studyFigure: "Figure of the study",
    save: "Save, command line, Python",
    command: "Command line",
    commandOf: "Command line of the study",
    pythonOf: "Python code of the study",
    python: "Python code",
    known: "This motion, and those that coexist",
    this: "This motion",
    coexisting: "Coexisting motions",
    unstable: "include unstable orbits",
    several: "{count} stable motions coexist here: one click each, below.",
    motion: "The motion",
    detail: "The motion in detail",
    contactFigure: "Height above the sample and force on the tip against time; force against height",
    portraitFigure: "Deflection against time, phase portrait, harmonics and multipliers",
    keys: "In every figure: drag a rectangle to zoom, or hold Ctrl and turn the wheel; double-click or press 0 to show everything. Keys: arrows move the cross, N selects the next panel, + and − zoom, Enter selects the point.",
    files: "Files and numbers of the motion",
    saveThis: "Save this motion",
    figure: "Figure",
    figureMotion: "motion",
    figureContact: "height and force",
    caseFile: "Case file",
    code: "Command line, Python",
    observables: "Observables",
    quantity: "quantity",
    value: "value",
    regime: "regime",
    distance: "distance",
    fixed: "Comparison with fixed time steps",
    steps: "Runge–Kutta steps per period",
    fixedFigure: "Motion with fixed time steps",
    off: "0: off. Too few steps give motions that the equations do not have.",
  },
  guides: {
    bistable: ["Two motions at one distance", "At 18 nm this lever has two stable motions: “Coexisting motions” lists both. Press the other one. The tip then stops touching, the peak force goes from about 1 nN to zero and the phase from below 90° to above, although no value has changed. Which one an instrument shows depends on its history."],
    phase: ["Why the phase turns", "Far away the phase lags by 90°, at resonance. Move the distance from 24 nm to 19 nm: attraction lowers the resonance and the lag grows to 110°. At 18 nm a run from rest ends in repulsion, which raises the resonance: the lag falls to 68°. The curve of the phase shows both branches, with the present motion on it."],
    doubling: ["Period doubling", "Each dot is the largest deflection in one drive period. Read from right to left: below Ω = 2.91 there are two dots, since the motion repeats only after two drive periods; around 2.6 it is chaotic. Click a dot: the lever above shows that motion."],
    image: ["A false step in an image", "The sample is flat; between 150 nm and 300 nm a patch attracts the tip less. There the lever jumps from its attractive to its repulsive state and stays, so the height in the image changes although the surface does not, and trace and retrace differ."],
    step: ["What a too coarse time step invents", "The equations give a motion of period 1. “Comparison with fixed time steps”, at the bottom, shows what 80 Runge–Kutta steps per period make of it. Try 40, then 400."],
    plan: ["An imaging window below a peak force", "The black line surrounds the free amplitudes and setpoints at which the peak force stays below 4 nN and no second motion exists. Click inside it: the case takes these values. Change the force, then press Compute."],
  },
  linkWords: { qr: "QR code of the link", tooLong: "The link is too long for a QR code.", copied: "Copied. The link opens this view:", copy: "Copy this link; it opens this view:", address: "Link to this view" },
  knobs: {
    groups: { distance: "Distance or setpoint", drive: "Drive", sample: "Sample", lever: "Lever and tip", model: "Numbers of the equations", more: "Further keys" },
    further: "modes, forms, second tone", more: "{count} more", other: "{words}, or another key for the same",
  },
  studies: {
    heading: "Further studies",
    lessons: "Lessons",
    compute: "Compute", stop: "Stop", range: "Range", fields: "{count} more",
    fitted: "computed for other values",
    long: "This will take {time} here.", terminal: "To compute it at the terminal, on all processors, save the case and run:",
    minute: "over a minute", minutes: "roughly {count} min", hours: "roughly {count} h",
    about: {
      approach: "Amplitude, phase, energy and peak force against the distance, coming nearer and going away.",
      diagram: "The largest deflections of the motions that runs lead to, against a parameter: where a motion doubles its period or becomes chaotic.",
      branches: "Every motion followed against a parameter, stable or not: where motions begin, end and meet.",
      resonance: "Amplitude and phase against the frequency, up and down: the resonance curve and its jumps.",
      basin: "To which motion each initial deflection and velocity leads.",
      map: "The kinds of motion, the peak force, or the number of motions over two parameters.",
      image: "A line of an image under feedback: height, amplitude error, phase and peak force over a known surface.",
      levers: "Levers of the catalogue on this sample, at the free amplitude and the setpoint: a click on a row chooses that lever.",
      data: "A measured curve over that of the model, the fit of the model to it, and its force without a contact law. Drop an instrument’s file (JPK, Bruker, Asylum, Nanosurf …) or a CSV file on the page, or choose one; columns of a CSV file are named as in “distance (nm)”, “amplitude (nm)”, “phase (deg)”. The file stays in this page.",
      simulate: "One signal in place of the periodic drive: how the lever follows it, where it touches, and how it rings down. As in “pulse 1us times 400”, “chirp 300kHz 350kHz 3ms”, “sinc 1MHz 40us”.",
      plan: "Where every motion meets the conditions, over free amplitude and setpoint: the window for imaging.",
    },
    other: "computed for other values – compute again",
    refines: "{words}; “Compute” refines the curve and follows its branches",
    stopped: "stopped",
    pin: "Pin", unpin: "Unpin", pinAbout: "Keep the curves of this figure behind the next ones",
    slider: "{words}, slider",
    tooLarge: "{name} has {size} bytes; the page reads at most {most}, the terminal more",
    drawnMotion: ": a motion is drawn here",
    follow: "keep the state while I turn a knob, as an instrument does",
  },
  zero: "0 throughout, not drawn: {names}",
  show: {
    heading: "Lessons",
    lead: "Each step asks, the room chooses, and the lever shows. Every number is computed here and now.",
    keys: "Keys: → or Page Down next, ← back, A B C choose an answer, W “What if?”, I black on white or the reverse, Esc close.",
    back: "Back", next: "Next", show: "Show", end: "End",
    place: "{step} of {steps}",
    whatIf: "What if? (W)",
    whatIfHead: "What if?",
    phones: "Phones: {address}",
    code: "QR code: this step on a phone",
    tooLong: "The link is too long for a QR code.",
    computing: "computing …",
    failed: "Not computed: {reason}",
    damaged: "This link is damaged: it contains no lesson.",
    wrong: "This lesson is damaged: {part} is missing or wrong.",
    unknown: "There is no lesson “{name}” here.",
    open: "Open my own lesson …",
    template: "Save a lesson as a pattern",
    letter: "Hold it up. A tap goes back.",
    right: "right",
    row: "{name}: phase lag {phase}, peak force {force}, distance {distance}",
    time: "time", disturbance: "disturbance",
    keyNames: {
      "drive.setpoint": "Setpoint", "gap.tip": "Distance", "drive.free_amplitude": "Free amplitude", "sample.modulus": "Sample modulus", "cantilever.k": "Spring constant",
      "cantilever.Q": "Q", "cantilever.f0": "Resonance", "drive.frequency": "Drive", omega: "Drive frequency Ω", steps: "Steps per period", "study.rate": "Line rate", "study.gain": "Gain (1/s)",
    },
    /** Words of the program's figures. */
    figure: {
      surface: "surface", trace: "trace", retrace: "retrace", "attractive state": "attractive state", "height $z$": "height $z$", "position $x$": "position $x$",
      "drive frequency $Ω$": "drive frequency $Ω$", "max $W$ in a drive period": "max $W$ in a drive period", "time $τ / T$": "time $τ / T$", "drive periods": "drive periods", "tip deflection $W$": "tip deflection $W$",
    },
    exact: "exact",
    periodOf: "period {period}", noPeriod: "no period", grows: "no motion at all: it grows without bound",
  },
  /** Lessons of the lecture: words of lessons.js. */
  lessons: {
    states: {
      title: "Two states at one setpoint",
      steps: [
        { ask: "We come nearer until the amplitude is {drive.setpoint} of the free one. How many stable motions does the lever have there?", answers: ["one", "{states}", "as many as one likes"], says: "It has {states}: the attractive one at a distance of {attractive.distance}, and the repulsive one at {repulsive.distance}. The dashed one between them is unstable." },
        { ask: "We came from afar, slowly. In which of them is the lever, and how hard does it press?", answers: ["attractive: {attractive.force}", "repulsive: {repulsive.force}", "it switches all the time"], says: "In the attractive one. It does not touch the sample: its peak force is {attractive.force}, and its phase lags by {attractive.phase}." },
        { ask: "The lever is knocked into the other state. The surface is flat, no value changed. What does the image show?", answers: ["nothing", "a step of {step}", "noise"], says: "A step of {step}: the feedback moves from {attractive.distance} to {repulsive.distance}. The phase turns by {turn}, and the tip presses with {repulsive.force}." },
        { ask: "We want only one state. We raise the free amplitude from {before.drive.free_amplitude} to {drive.free_amplitude}. Now there are …", answers: ["still both", "the attractive state alone", "the repulsive state alone"], says: "The repulsive state alone is left. The price is force: {force} in place of {before.repulsive.force}." },
      ],
    },
    phase: {
      title: "Why the phase turns",
      steps: [
        { ask: "Far from the sample, driven at its resonance: by how much does the lever lag behind its drive?", answers: ["0°", "{phase}", "180°"], says: "By {phase}, about a quarter of a period: the drive pushes when the lever is fastest." },
        { ask: "We come nearer, down to a setpoint of {drive.setpoint}. The sample attracts the tip. The lag …", answers: ["falls", "stays", "grows"], says: "It grows to {phase}. Attraction acts like a softer spring: the resonance falls below the drive, and the lever comes too late." },
        { ask: "Same setpoint, but now the tip taps the surface. The lag is …", answers: ["{repulsive.phase}", "90°", "{attractive.phase}, as before"], says: "It is {repulsive.phase}. Contact acts like a stiffer spring: the resonance rises above the drive. The tip presses with {repulsive.force}." },
        { ask: "Down to {drive.setpoint}: {before.attractive.phase} and {before.repulsive.phase} become …", answers: ["closer to 90°", "farther from 90°", "the same"], says: "They become {attractive.phase} and {repulsive.phase}. Without losses the two are mirrored at 90°: the amplitude alone sets the phase." },
      ],
    },
    image: {
      title: "What the image shows that is not there",
      steps: [
        { ask: "A flat surface. Between 150 nm and 300 nm lies a patch that attracts the tip less. What does the image show?", answers: ["a flat line", "a step where the patch begins", "a hole as wide as the patch"], says: "A step of {step}. On the patch the lever jumps to its repulsive state, and it keeps it behind the patch. No part of this height is the surface." },
        { ask: "Why does the height change, although the feedback holds the same amplitude?", answers: ["each state has its own distance", "the patch is lower", "the feedback is too slow"], says: "At this amplitude the attractive state lies at {attractive.distance}, the repulsive one at {repulsive.distance}. The phase tells them apart: {attractive.phase} and {repulsive.phase}." },
        { ask: "Now a real step of {study.height}, scanned at {study.rate}. What happens behind its falling edge?", answers: ["the image follows", "the tip breaks", "the tip flies, the image is late"], says: "The tip flies: the amplitude can only grow to its free value, so the feedback sees a small error and lowers the lever slowly. The image shows a slope." },
        { ask: "How does one see the edge as it is?", answers: ["a larger setpoint", "scan slower", "press harder from the start"], says: "Scan slower: at {study.rate} the slope is about {ratio.rate} times shorter along the line, because the feedback needs the same time." },
      ],
    },
    force: {
      title: "How hard does it press?",
      steps: [
        { ask: "An elastic sample. The setpoint goes from {before.drive.setpoint} down to {drive.setpoint}. The peak force of {before.force} becomes …", answers: ["{force}", "twice as large", "five times as large"], says: "It becomes {force}: {ratio.force} times as large. The setpoint is a poor measure of the force." },
        { ask: "We double the free amplitude, at the same setpoint. The peak force becomes …", answers: ["the same", "{ratio.force} times as large", "four times as large"], says: "It rises from {before.force} to {force}: {ratio.force} times. A smaller amplitude is the gentle way." },
        { ask: "A sample that is ten times as stiff. The peak force becomes …", answers: ["smaller", "{ratio.force} times as large", "ten times as large"], says: "From {before.force} to {force}, and the tip sinks in by {indentation} in place of {before.indentation}. The contact is shorter." },
        { ask: "A lever with {cantilever.k} in place of {before.cantilever.k}, same amplitude, same Q. The peak force becomes …", answers: ["the same", "{ratio.k} times as large, as the spring constant", "{ratio.force} times as large"], says: "From {before.force} to {force}: {ratio.force} times. On a soft sample a stiff lever sinks in by {indentation} in place of {before.indentation}." },
      ],
    },
    vacuum: {
      title: "Why a soft lever is slow in vacuum",
      steps: [
        { ask: "A lever in air: resonance {cantilever.f0}, Q {cantilever.Q}. Its amplitude is disturbed. After what time is 1/e of that left?", answers: ["one period, {periodTime}", "{settle}", "one second"], says: "After {settle}: {settlePeriods} periods. The lever loses a small part of its energy in each period." },
        { ask: "The same lever in vacuum, Q {cantilever.Q}. Now it takes …", answers: ["the same time", "less, there is no air", "{settle}"], says: "It takes {settle}, {ratio.settle} times as long. What makes the resonance sharp makes the amplitude slow." },
        { ask: "A softer lever: {cantilever.k}, resonance {cantilever.f0}. Now it takes …", answers: ["the same", "less", "{settle}"], says: "{settle}: the same {settlePeriods} periods, but each is {ratio.settle} times as long." },
        { ask: "A line has 256 points, and the amplitude is to settle once at each. How long does one line take?", answers: ["{settle}", "{line}", "one hour"], says: "It takes {line}. In vacuum one does not wait for the amplitude: one follows the frequency, which answers at once." },
      ],
    },
    doubling: {
      title: "Period doubling",
      steps: [
        { ask: "At Ω = {before.omega} the motion repeats after {before.period} drive period. We lower the drive frequency to {omega}. Now it repeats after …", answers: ["1 period", "{period} periods", "never"], says: "After {period} periods: two different periods take turns." },
        { ask: "Lower still, to {omega}. It repeats after …", answers: ["1 period again", "{period} periods", "3 periods"], says: "After {period} periods: what repeated itself has doubled once more." },
        { ask: "At Ω = {omega}?", answers: ["{before.period} periods", "16 periods", "never"], says: "Never: the motion is chaotic. Two neighbouring motions part e-fold with the exponent {exponent} per period." },
        { ask: "The largest deflection in each period, against Ω: how does a motion that repeats after 2 periods look?", answers: ["two dots at one Ω", "a jump", "a gap"], says: "Two dots at one Ω. To the left they become four, then bands of chaos, with windows of regular motion in them." },
      ],
    },
    steps: {
      title: "What a coarse time step invents",
      steps: [
        { ask: "The exact motion has {before.exactPeriod}. A program goes on in {steps} equal time steps per period. It shows …", answers: ["the same", "{fixed}", "nothing, it stops"], says: "It shows {fixed}. The equations do not have this motion: each contact begins between two steps, and the program sees it late." },
        { ask: "More steps are better: {steps} per period. It shows …", answers: ["{exactPeriod}, the exact motion", "{before.fixed}, as before", "{fixed}"], says: "It shows {fixed}. This is wrong in another way." },
        { ask: "{steps} steps per period. It shows …", answers: ["{before.fixed}, as before", "{fixed}, as the equations", "chaos"], says: "It shows {fixed}, like the equations. Are {steps} steps therefore enough?" },
        { ask: "To be sure, we take {steps} steps. It shows …", answers: ["{before.fixed}, now it is certain", "nothing else is possible", "{fixed}"], says: "It shows {fixed}. More steps do not settle it; locating each contact does. Here that gives {exactPeriod}." },
      ],
    },
  },
  scan: {
    heading: "Scan under feedback",
    knobs: { surface: "Surface", height: "Height", size: "Length", setpoint: "Setpoint", rate: "Lines/s", gain: "Gain (1/s)" },
    surfaces: { "of the case": "mine (of the case)", step: "a step", grating: "a grating", particle: "a particle", flat: "flat", drawn: "drawn by hand" },
    trace: "trace",
    retrace: "retrace",
    directions: { trace: "trace", retrace: "retrace" },
    states: { free: "free", attractive: "attractive", repulsive: "repulsive", irregular: "irregular" },
    axes: { x: "position along the line $x$", deflection: "deflection", force: "peak force", amplitude: "amplitude", phase: "phase lag", height: "height" },
    setpoint: "setpoint",
    surface: "surface",
    image: "image, {direction}",
    strips: "One line of the image: deflection, peak force, lock-in amplitude, lock-in phase, surface and image along the line",
    time: "The line takes {time} in one direction. A click shows the states at the distance there.",
    noLever: "Only a lever makes images: this example has no lever with units. Choose one of “Examples with units”.",
    drawIt: "Draw the surface: drag in the box above.",
    computing: "computing the line …",
    progress: "the exact line follows: {progress}",
    approximate: "≈ averaged lever; the exact line follows in a moment",
    exact: "exact: every drive period",
    stale: "of the former value: {knob} {value}",
    former: "of the former values",
    lost: "The lever lost the surface at {x} ({direction}) and did not find it again on this line.",
    lags: "The feedback lags: the amplitude is off its setpoint over {share} % of the line",
    flies: "most from {x} to {until} ({direction}), where the tip flies{height}",
    presses: "most from {x} to {until} ({direction}), where the tip presses{height}",
    high: " and the image is up to {height} too high",
    low: " and the image is up to {height} too low",
    keepsUp: "The feedback keeps up with the surface.",
    follows: "The image follows the surface to {rms}.",
    off: "≈ The amplitude is off its setpoint over {share} % of the line.",
    on: "≈ The amplitude keeps its setpoint along the line.",
    changes: "The lever changes from the {from} to the {to} state at {x} ({direction}); this alone shifts the height by {height}.",
    more: "That is the largest of {count} such changes.",
    keeps: "The lever keeps its state.",
    rings: "The loop rings: its gain of {gain}/s is above the largest stable one, {largest}/s.",
    ringsAlways: "The loop rings: no gain makes it stable.",
    mayRing: "The loop may ring after large errors: it rings above a gain of {largest}/s; you are at {share} % of that.",
    loop: "The loop rings above a gain of {largest}/s; you are at {share} % of that.",
    force: "It presses with up to {force}.",
    touchesNot: "It never touches the sample.",
    command: "For the terminal",
  },
  busy: "computing …",
  loading: "loading …",
};

/** The words of each language. */
export const tongues = { en: english, de: german };
let chosen = english;

/** Chooses a language by its two letters; an unknown one is English. */
export function speak(code) {
  chosen = tongues[code] ?? english;
  document.documentElement.lang = chosen === english ? "en" : code;
}

/** The other language that the page has. */
export const other = () => (chosen === english ? "de" : "en");

const find = (tongue, path) => path.split(".").reduce((at, name) => at?.[name], tongue);

/** A text with its numbers as the chosen language writes them: "18.3 nm" is "18,3 nm" in German. Names with points,
 *  lists of numbers and formulas stay. What is copied, saved or sent is never converted. */
export function local(text) {
  if (chosen !== german) return String(text);
  return String(text).replace(/[\w.,]*\d\.\d[\w.,]*/g, (word) => (/^\d+\.\d+(e\d*)?[.,]?$/i.test(word) ? word.replace(".", ",") : word));
}

const VERBATIM = ["version", "address"]; // placeholders whose values are not numbers

/** The words at a path such as `states.heading`, in the chosen language or else in English, with these
 *  values in them. */
export function t(path, values = {}) {
  const words = find(chosen, path) ?? find(english, path);
  if (typeof words !== "string") return words ?? path;
  return words.replace(/\{(\w+)\}/g, (whole, name) => (VERBATIM.includes(name) ? values[name] : name in values ? local(values[name] ?? whole) : whole));
}

/** A field of a form in the page's words: its label, the sentence about it, its placeholder and the texts of its
 *  choices. What the page has no words for has those of the program's tables. */
export function worded(form, { name, words, about = "", hint = "", choices = [] }) {
  const { of, hints, choices: texts } = chosen.fields;
  const own = of[form]?.[name] ?? {};
  return { words: own.words ?? words, about: own.about ?? about, hint: own.hint ?? hints[hint] ?? hint, choices: choices.map((choice) => own.choices?.[choice] ?? texts[choice] ?? choice) };
}

/** The words of a quantity in the chosen language, or else the program's own; those of a list such as the readout,
 *  which has shorter ones. */
export function quantity(name, words, list = "") {
  const own = list ? chosen.quantities?.[list] : chosen.quantities;
  return own?.[name] ?? words;
}

/** Sentences of the program in the chosen language; one that it does not have stays. */
export function sentences(text) {
  const said = text.split(/(?<=\.) /).map((one) => {
    const numbers = one.match(/\d+(\.\d+)?/g) ?? [];
    const own = chosen.sentences?.[one.replace(/\d+(\.\d+)?/g, "#")];
    return own?.replace(/#/g, () => numbers.shift()) ?? one;
  });
  return local(said.join(" "));
}

/** Puts the words into the page: an element names its own by `data-t`, its label by `data-t-label`. */
export function fill(root = document) {
  for (const element of root.querySelectorAll("[data-t]")) element.textContent = t(element.dataset.t);
  for (const element of root.querySelectorAll("[data-t-label]")) element.setAttribute("aria-label", t(element.dataset.tLabel));
}
