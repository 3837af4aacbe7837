// The families in which contact laws are offered. Each law of the program is in one of them.

export const FAMILIES = {
  elastic: ["hertz", "cone", "punch", "thin-sphere", "thin-cone", "thin-punch", "layer-sphere", "layer-cone", "layer-punch", "spring-damper"],
  sticky: ["dmt", "jkr", "adhesion-hysteresis", "van-der-waals", "van-der-waals-cone", "van-der-waals-punch", "sphere-cone", "lennard-jones", "morse", "pair-lennard-jones", "inverse-power"],
  wet: ["capillary", "dlvo", "solvation"],
  slow: ["kelvin-voigt", "moving-surface", "standard-linear-solid", "generalised-maxwell", "prony-sphere", "prony-cone", "prony-punch", "voigt-sphere", "voigt-sphere-pulling", "voigt-cone", "voigt-cone-pulling", "voigt-punch", "voigt-punch-pulling", "viscous-contact", "exponential-damping", "power-damping"],
  electric: ["electrostatic", "electrostatic-ac", "coulomb"],
  measured: ["table", "formula"],
};
