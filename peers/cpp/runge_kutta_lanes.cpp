// Written by hand for this one model: fixed-step Runge-Kutta with eight motions side by side
// in vector lanes (GCC's vector extension, which a machine without AVX-512 splits up).
//
// The regime of each lane is frozen during a step. Where the gap changes sign, or may have
// dipped, the lane does that step alone: crossings by safeguarded Newton on the length of a
// step of the same method. Methods: rk4, rk8 (Dormand and Prince's 12 stages), and rk4naive,
// which tests the gap in every stage and locates nothing. The setting is steps a period.
#include "dop853.hpp"
#include "work.hpp"

namespace {

constexpr int LANES = 8;
typedef double Lanes __attribute__((vector_size(8 * LANES)));
typedef long long Mask __attribute__((vector_size(8 * LANES)));

struct Rk4 {
  static constexpr int stages = 4;
  static constexpr double A[4][4] = {{}, {0.5}, {0.0, 0.5}, {0.0, 0.0, 1.0}};
  static constexpr double B[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  static constexpr double C[4] = {0.0, 0.5, 0.5, 1.0};
};

struct Rk8 {
  static constexpr int stages = 12;
  static constexpr auto &A = DOP853_A;
  static constexpr auto &B = DOP853_B;
  static constexpr auto &C = DOP853_C;
};

/// The model with what does not change in time worked out.
struct Coefficients {
  Parameters parameters;
  double stiffness[MODES], integral[MODES], mass;
};

Coefficients coefficients_of(const Parameters &p) {
  Coefficients c{p, {}, {}, 4.0 * p.alpha1 / (1.0 + 12.0 * p.alpha1)};
  for (int i = 0; i < MODES; i++) {
    c.stiffness[i] = std::pow(BETA[i], 4);
    c.integral[i] = integral_of_mode(i);
  }
  return c;
}

/// The drive at one time: force on each mode, and what it adds to the gap and its rate.
struct Drive {
  double force[MODES], gap, rate;
};

Drive drive_at(const Coefficients &c, double t) {
  const Parameters &p = c.parameters;
  const double s = std::sin(p.omega * t), k = std::cos(p.omega * t);
  const double sine = p.alpha2 * p.omega * p.omega * s, cosine = -p.alpha2 * p.alpha3 * p.omega * k;
  Drive d;
  for (int i = 0; i < MODES; i++)
    d.force[i] = sine * ((i % 2 ? -2.0 : 2.0) * p.alpha1 + c.integral[i]) + cosine * c.integral[i];
  d.gap = p.alpha2 * s + p.alpha5;
  d.rate = p.alpha2 * p.omega * k;
  return d;
}

template <class T>
T gap_of(const T *y, double drive) {
  return 2.0 * (y[0] - y[1] + y[2]) + drive;
}

/// The gap's rate, of lanes or of one motion.
template <class T>
T rate_of(const T *y, double drive) {
  return 2.0 * (y[3] - y[4] + y[5]) + drive;
}

Lanes in_contact(const Lanes &gap) {
  const Lanes zero = {}, one = zero + 1.0;
  return gap <= 0.0 ? one : zero;
}
double in_contact(double gap) { return gap <= 0.0 ? 1.0 : 0.0; }

template <class T>
__attribute__((always_inline)) inline void accelerations(const Coefficients &c, const Drive &d,
                                                         const T *y, const T &contact, T *a) {
  const Parameters &p = c.parameters;
  T f0 = d.force[0] - c.stiffness[0] * y[0] - p.alpha3 * y[3];
  T f1 = d.force[1] - c.stiffness[1] * y[1] - p.alpha3 * y[4];
  T f2 = d.force[2] - c.stiffness[2] * y[2] - p.alpha3 * y[5];
  const T pressed = contact * (2.0 * p.alpha4 * gap_of(y, d.gap) + 2.0 * p.alpha6 * rate_of(y, d.rate));
  f0 -= pressed;
  f1 += pressed;
  f2 -= pressed;
  const T tip = c.mass * (f0 - f1 + f2);
  a[0] = f0 - tip;
  a[1] = f1 + tip;
  a[2] = f2 - tip;
}

template <class M, class T, bool NAIVE>
__attribute__((always_inline)) inline void step(const Coefficients &c, const Drive *drive, double h,
                                                const T *y, const T &contact, T *out) {
  T slope[M::stages][DIMENSION];
#pragma GCC unroll 12
  for (int i = 0; i < M::stages; i++) {
    T z[DIMENSION];
#pragma GCC unroll 6
    for (int d = 0; d < DIMENSION; d++) z[d] = y[d];
#pragma GCC unroll 12
    for (int j = 0; j < i; j++)
      if (M::A[i][j] != 0.0) {
#pragma GCC unroll 6
        for (int d = 0; d < DIMENSION; d++) z[d] += (h * M::A[i][j]) * slope[j][d];
      }
    for (int d = 0; d < MODES; d++) slope[i][d] = z[MODES + d];
    const T regime = NAIVE ? in_contact(gap_of(z, drive[i].gap)) : contact;
    accelerations<T>(c, drive[i], z, regime, &slope[i][MODES]);
  }
#pragma GCC unroll 6
  for (int d = 0; d < DIMENSION; d++) {
    T z = y[d];
#pragma GCC unroll 12
    for (int j = 0; j < M::stages; j++)
      if (M::B[j] != 0.0) z += (h * M::B[j]) * slope[j][d];
    out[d] = z;
  }
}

/// One motion's step of any length, from any time.
template <class M>
void step_alone(const Coefficients &c, double t, double h, const double *y, double contact,
                double *out) {
  Drive drive[M::stages];
  for (int i = 0; i < M::stages; i++) drive[i] = drive_at(c, t + M::C[i] * h);
  step<M, double, false>(c, drive, h, y, contact, out);
}

/// One motion's step from `t` to `t + h` in which its regime changes, or may.
template <class M>
void step_with_switches(const Coefficients &c, double t, double h, double *y, double &contact) {
  double left = h, z[DIMENSION];
  for (int changes = 0; changes < 20; changes++) {
    const double sign = contact > 0.0 ? -1.0 : 1.0;
    auto gap = [&](double s) {
      step_alone<M>(c, t, s, y, contact, z);
      return sign * gap_of(z, drive_at(c, t + s).gap);
    };
    auto rate = [&](double s) { return sign * rate_of(z, drive_at(c, t + s).rate); };
    const Drive here = drive_at(c, t);
    const double g0 = sign * gap_of(y, here.gap), d0 = sign * rate_of(y, here.rate);
    double high = left, at_high = gap(left);
    bool crosses = at_high <= 0.0;
    if (!crosses && dip_of_cubic(left, g0, d0, at_high, rate(left)) <= 0.0)
      for (int i = 1; i < 16 && !crosses; i++) {
        high = left * i / 16;
        at_high = gap(high);
        crosses = at_high <= 0.0;
      }
    if (!crosses) {
      gap(left);
      std::copy(z, z + DIMENSION, y);
      return;
    }
    double low = 0.0, at_low = g0;
    // On the surface: some moment after the start must be inside.
    for (double part = high; at_low < 1e-14 && part > 1e-12 * high;) {
      part *= 0.5;
      at_low = gap(part);
      low = part;
    }
    if (at_low <= 0.0) {
      contact = 1.0 - contact;
      continue;
    }
    double s = (low * at_high - high * at_low) / (at_high - at_low);
    if (!(s > low && s < high)) s = 0.5 * (low + high);
    for (int i = 0; i < 40; i++) {
      const double value = gap(s);
      (value > 0.0 ? low : high) = s;
      double next = s - value / rate(s);
      if (std::fabs(next - s) < 1e-15 * (1.0 + std::fabs(t)) || std::fabs(value) < 2e-17) break;
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      if (high - low < 1e-16) break;
      s = next;
    }
    std::copy(z, z + DIMENSION, y);
    t += s;
    left -= s;
    contact = 1.0 - contact;
    if (left < 1e-14 * h) return;
  }
  step_alone<M>(c, t, left, y, contact, z);
  std::copy(z, z + DIMENSION, y);
}

bool any(const Mask &mask) {
  long long all = 0;
  for (int q = 0; q < LANES; q++) all |= mask[q];
  return all != 0;
}

/// Eight motions with common parameters.
template <class M, bool NAIVE>
class Eight {
 public:
  Eight(const Parameters &p, int steps)
      : c_(coefficients_of(p)), steps_(steps), h_(2.0 * M_PI / p.omega / steps) {
    for (int i = 0; i < steps; i++)
      for (int j = 0; j < M::stages; j++) drive_.push_back(drive_at(c_, (i + M::C[j]) * h_));
    drive_.push_back(drive_at(c_, steps * h_));
  }

  void start(int lane, const State &y) {
    for (int d = 0; d < DIMENSION; d++) y_[d][lane] = y[d];
    const double g = gap_of(y.data(), drive_[0].gap);
    const bool touching = g == 0.0 ? rate_of(y.data(), drive_[0].rate) <= 0.0 : g < 0.0;
    contact_[lane] = touching ? 1.0 : 0.0;
  }

  State state(int lane) const {
    State y;
    for (int d = 0; d < DIMENSION; d++) y[d] = y_[d][lane];
    return y;
  }

  void run_period() {
    Lanes next[DIMENSION];
    for (int i = 0; i < steps_; i++) {
      const Drive *drive = &drive_[static_cast<size_t>(i) * M::stages];
      step<M, Lanes, NAIVE>(c_, drive, h_, y_, contact_, next);
      if (!NAIVE) switch_lanes(i, drive[0], drive_[static_cast<size_t>(i + 1) * M::stages], next);
      std::copy(next, next + DIMENSION, y_);
    }
  }

 private:
  void switch_lanes(int i, const Drive &before, const Drive &after, Lanes *next) {
    const Lanes sign = 1.0 - 2.0 * contact_;
    const Lanes g0 = gap_of(y_, before.gap) * sign, d0 = rate_of(y_, before.rate) * sign;
    const Lanes g1 = gap_of(next, after.gap) * sign, d1 = rate_of(next, after.rate) * sign;
    const Mask dips = (d0 < 0.0) & (d1 > 0.0) & (g0 + 0.5 * h_ * d0 <= 0.0);
    const Mask suspect = (g1 <= 0.0) | dips;
    if (!any(suspect)) return;
    for (int lane = 0; lane < LANES; lane++) {
      if (!suspect[lane]) continue;
      State y = state(lane);
      double contact = contact_[lane];
      step_with_switches<M>(c_, i * h_, h_, y.data(), contact);
      for (int d = 0; d < DIMENSION; d++) next[d][lane] = y[d];
      contact_[lane] = contact;
    }
  }

  Coefficients c_;
  int steps_;
  double h_;
  std::vector<Drive> drive_;
  Lanes y_[DIMENSION] = {}, contact_ = {};
};

template <class M, bool NAIVE>
int work(const Options &o) {
  const int steps = std::max(1, static_cast<int>(o.setting));
  const bool wall = o.threads > 1;
  if (o.work == "first") {
    Eight<M, NAIVE> eight(Parameters{}, steps);
    double best = std::numeric_limits<double>::infinity();
    std::vector<State> states;
    const double until = now(true) + o.seconds;
    for (int repeat = 0; repeat < 3 || (repeat < 1000 && now(true) < until); repeat++) {
      states.clear();
      for (int lane = 0; lane < LANES; lane++) eight.start(lane, State{});
      const double start = now(false);
      for (int k = 0; k < 20; k++) {
        eight.run_period();
        states.push_back(eight.state(0));
      }
      best = std::min(best, now(false) - start);
    }
    // Eight motions were run; one costs an eighth.
    print_first(best / LANES, states);
  } else if (o.work == "long") {
    Eight<M, NAIVE> eight(Parameters{}, steps);
    for (int lane = 0; lane < LANES; lane++) eight.start(lane, State{});
    const double start = now(false), until = now(true) + o.seconds;
    int done = 0;
    while (done < 2000 && now(true) < until) {
      eight.run_period();
      done++;
    }
    print_sample((now(false) - start) / LANES, "periods", done);
  } else if (o.work == "sweep") {
    const std::vector<State> starts = sweep_starts();
    const double start = now(wall);
    const int done = as_many_as_fit(o, SWEEP_VALUES, [&](int k) {
      Eight<M, NAIVE> eight(sweep_parameters(scattered(k, SWEEP_VALUES, 247)), steps);
      for (int lane = 0; lane < LANES; lane++) eight.start(lane, starts[lane]);
      std::vector<State> kept;
      for (int period = 1; period <= SWEEP_PERIODS; period++) {
        eight.run_period();
        for (int lane = 0; lane < LANES && period > SWEEP_PERIODS - SWEEP_KEPT; lane++)
          kept.push_back(eight.state(lane));
      }
    });
    print_sample(now(wall) - start, "runs", static_cast<long>(done) * SWEEP_STARTS);
  } else if (o.work == "basin") {
    const int count = BASIN_SIDE * BASIN_SIDE;
    const Eight<M, NAIVE> rest(Parameters{}, steps);
    std::vector<State> ends(count);
    const double start = now(wall);
    const int done = as_many_as_fit(o, count / LANES, [&](int k) {
      Eight<M, NAIVE> eight = rest;
      int points[LANES];
      for (int lane = 0; lane < LANES; lane++) {
        points[lane] = scattered(k * LANES + lane, count, 24721);
        eight.start(lane, basin_start(points[lane]));
      }
      for (int period = 0; period < BASIN_PERIODS; period++) eight.run_period();
      for (int lane = 0; lane < LANES; lane++) ends[points[lane]] = eight.state(lane);
    });
    print_sample(now(wall) - start, "runs", static_cast<long>(done) * LANES);
  } else {
    std::fprintf(stderr, "works: first, long, sweep, basin\n");
    return 2;
  }
  return 0;
}

}  // namespace

int main(int argc, char **argv) {
  const Options o = options_of(argc, argv);
  if (o.method == "rk4naive") return work<Rk4, true>(o);
  if (o.method == "rk4") return work<Rk4, false>(o);
  return work<Rk8, false>(o);
}
