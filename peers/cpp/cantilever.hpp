// The cantilever with three modes, Eqs. (10)-(18), for the C++ peers. Regime 0 is free
// flight, regime 1 contact; a state is (a_1, a_2, a_3, and their rates).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

constexpr int MODES = 3;
constexpr int DIMENSION = 2 * MODES;
using State = std::array<double, DIMENSION>;

/// The roots of cos(b) cosh(b) = -1.
constexpr double BETA[MODES] = {1.8751040687119611664, 4.6940911329741745764,
                                7.8547574382376125649};

/// The paper's parameters, Eq. (26), with a tip mass.
struct Parameters {
  double omega = 2.6, alpha1 = 0.1, alpha2 = 0.1, alpha3 = 0.1, alpha4 = 20.0, alpha5 = 0.0,
         alpha6 = 0.2;
};

/// The integral of a mode over the beam.
inline double integral_of_mode(int i) {
  const double b = BETA[i];
  return 2.0 * (std::cosh(b) + std::cos(b)) / (std::sinh(b) + std::sin(b)) / b;
}

struct Cantilever {
  Parameters parameters;
  double period;
  double tip[MODES];
  /// By regime: M^-1 K, M^-1 C, and M^-1 times the force along sine, cosine and one.
  double stiffness[2][MODES][MODES], damping[2][MODES][MODES];
  double sine[2][MODES], cosine[2][MODES], constant[2][MODES];

  explicit Cantilever(const Parameters &p) : parameters(p), period(2.0 * M_PI / p.omega) {
    double squared = 0.0, integral[MODES];
    for (int i = 0; i < MODES; i++) {
      tip[i] = i % 2 ? -2.0 : 2.0;
      integral[i] = integral_of_mode(i);
      squared += tip[i] * tip[i];
    }
    for (int r = 0; r < 2; r++) {
      const double k4 = r ? p.alpha4 : 0.0, c6 = r ? p.alpha6 : 0.0;
      for (int i = 0; i < MODES; i++) {
        sine[r][i] = cosine[r][i] = constant[r][i] = 0.0;
        std::fill(stiffness[r][i], stiffness[r][i] + MODES, 0.0);
        std::fill(damping[r][i], damping[r][i] + MODES, 0.0);
        for (int k = 0; k < MODES; k++) {
          // M^-1 = 1 - alpha1 p p^T / (1 + alpha1 |p|^2)
          const double inverse =
              (i == k) - p.alpha1 * tip[i] * tip[k] / (1.0 + p.alpha1 * squared);
          for (int j = 0; j < MODES; j++) {
            const double load = tip[k] * tip[j];
            stiffness[r][i][j] += inverse * ((k == j) * std::pow(BETA[k], 4) + k4 * load);
            damping[r][i][j] += inverse * ((k == j) * p.alpha3 + c6 * load);
          }
          const double drive = p.alpha2 * p.omega * p.omega;
          sine[r][i] += inverse * (drive * (p.alpha1 * tip[k] + integral[k]) -
                                   p.alpha2 * k4 * tip[k]);
          cosine[r][i] -= inverse * p.alpha2 * p.omega *
                          (p.alpha3 * integral[k] + c6 * tip[k]);
          constant[r][i] -= inverse * k4 * p.alpha5 * tip[k];
        }
      }
    }
  }

  void rates(int regime, double t, const double *y, double *dy) const {
    const double s = std::sin(parameters.omega * t), c = std::cos(parameters.omega * t);
    for (int i = 0; i < MODES; i++) {
      double a = sine[regime][i] * s + cosine[regime][i] * c + constant[regime][i];
      for (int j = 0; j < MODES; j++)
        a -= stiffness[regime][i][j] * y[j] + damping[regime][i][j] * y[MODES + j];
      dy[i] = y[MODES + i];
      dy[MODES + i] = a;
    }
  }

  /// The gap between tip and sample, Eq. (8).
  double gap(double t, const double *y) const {
    double w = parameters.alpha2 * std::sin(parameters.omega * t) + parameters.alpha5;
    for (int i = 0; i < MODES; i++) w += tip[i] * y[i];
    return w;
  }

  double gap_rate(double t, const double *y) const {
    double w = parameters.alpha2 * parameters.omega * std::cos(parameters.omega * t);
    for (int i = 0; i < MODES; i++) w += tip[i] * y[MODES + i];
    return w;
  }

  /// Where a motion starts; on the surface the gap's rate decides (from rest: free).
  int regime_at(double t, const double *y) const {
    const double g = gap(t, y);
    return g == 0.0 ? gap_rate(t, y) <= 0.0 : g < 0.0;
  }
};

/// The least value of the cubic through two ends with their slopes, where it dips between.
inline double dip_of_cubic(double h, double g0, double d0, double g1, double d1) {
  const double least = std::min(g0, g1);
  if (!(d0 < 0.0 && d1 > 0.0)) return least;
  const double a = 2.0 * (g0 - g1) + h * (d0 + d1), b = 3.0 * (g1 - g0) - h * (2.0 * d0 + d1),
               c = h * d0;
  const double discriminant = b * b - 3.0 * a * c;
  if (discriminant < 0.0) return least;
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  double found = least;
  for (const double x : {a != 0.0 ? q / (3.0 * a) : -1.0, q != 0.0 ? c / q : -1.0})
    if (x > 0.0 && x < 1.0) found = std::min(found, ((a * x + b) * x + c) * x + g0);
  return found;
}
