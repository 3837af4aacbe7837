// SUNDIALS with its own root finding on the gap. Methods: adams and bdf (CVODE), erk54
// (ARKODE, Dormand-Prince) and erk85 (Fehlberg).
#include "work.hpp"

#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

namespace {

struct Problem {
  const Cantilever *cantilever;
  int regime;
};

int rates(realtype t, N_Vector y, N_Vector dy, void *data) {
  const auto *p = static_cast<Problem *>(data);
  p->cantilever->rates(p->regime, t, NV_DATA_S(y), NV_DATA_S(dy));
  return 0;
}

int gap(realtype t, N_Vector y, realtype *value, void *data) {
  value[0] = static_cast<Problem *>(data)->cantilever->gap(t, NV_DATA_S(y));
  return 0;
}

int jacobian(realtype, N_Vector, N_Vector, SUNMatrix j, void *data, N_Vector, N_Vector,
             N_Vector) {
  const auto *p = static_cast<Problem *>(data);
  for (int i = 0; i < MODES; i++)
    for (int k = 0; k < MODES; k++) {
      SM_ELEMENT_D(j, i, k) = 0.0;
      SM_ELEMENT_D(j, i, MODES + k) = i == k;
      SM_ELEMENT_D(j, MODES + i, k) = -p->cantilever->stiffness[p->regime][i][k];
      SM_ELEMENT_D(j, MODES + i, MODES + k) = -p->cantilever->damping[p->regime][i][k];
    }
  return 0;
}

/// CVODE or ARKODE behind one face.
class Solver {
 public:
  Solver(const Options &o, const Cantilever &c, const State &start)
      : explicit_(o.method.rfind("erk", 0) == 0), problem_{&c, c.regime_at(0.0, start.data())} {
    SUNContext_Create(nullptr, &context_);
    y_ = N_VNew_Serial(DIMENSION, context_);
    between_ = N_VNew_Serial(DIMENSION, context_);
    std::copy(start.begin(), start.end(), NV_DATA_S(y_));
    constexpr long most_steps = 100000000;
    if (explicit_) {
      memory_ = ERKStepCreate(rates, 0.0, y_, context_);
      ERKStepSetUserData(memory_, &problem_);
      ERKStepSStolerances(memory_, o.setting, o.setting);
      ERKStepSetTableNum(memory_, o.method == "erk54" ? ARKODE_DORMAND_PRINCE_7_4_5
                                                      : ARKODE_FEHLBERG_13_7_8);
      ERKStepSetInterpolantDegree(memory_, 5);
      ERKStepRootInit(memory_, 1, gap);
      ERKStepSetNoInactiveRootWarn(memory_);
      ERKStepSetMaxNumSteps(memory_, most_steps);
    } else {
      memory_ = CVodeCreate(o.method == "bdf" ? CV_BDF : CV_ADAMS, context_);
      CVodeInit(memory_, rates, 0.0, y_);
      CVodeSetUserData(memory_, &problem_);
      CVodeSStolerances(memory_, o.setting, o.setting);
      CVodeRootInit(memory_, 1, gap);
      CVodeSetNoInactiveRootWarn(memory_);
      CVodeSetMaxNumSteps(memory_, most_steps);
      if (o.method == "bdf") {
        matrix_ = SUNDenseMatrix(DIMENSION, DIMENSION, context_);
        linear_ = SUNLinSol_Dense(y_, matrix_, context_);
        CVodeSetLinearSolver(memory_, linear_, matrix_);
        CVodeSetJacFn(memory_, jacobian);
      } else {
        nonlinear_ = SUNNonlinSol_FixedPoint(y_, 0, context_);
        CVodeSetNonlinearSolver(memory_, nonlinear_);
      }
    }
    look_for_exit();
  }
  Solver(const Solver &) = delete;
  Solver &operator=(const Solver &) = delete;
  ~Solver() {
    if (explicit_)
      ERKStepFree(&memory_);
    else
      CVodeFree(&memory_);
    if (linear_) SUNLinSolFree(linear_);
    if (matrix_) SUNMatDestroy(matrix_);
    if (nonlinear_) SUNNonlinSolFree(nonlinear_);
    N_VDestroy(y_);
    N_VDestroy(between_);
    SUNContext_Free(&context_);
  }

  /// One step towards `end`, at most to where the regime ends; false where it failed.
  bool step(double end) {
    const int flag = explicit_ ? ERKStepEvolve(memory_, end, y_, &time_, ARK_ONE_STEP)
                               : CVode(memory_, end, y_, &time_, CV_ONE_STEP);
    exit_ = flag == (explicit_ ? ARK_ROOT_RETURN : CV_ROOT_RETURN);
    return flag >= 0;
  }

  double time() const { return time_; }

  /// The state at a time within the last step.
  State at(double t) {
    explicit_ ? ERKStepGetDky(memory_, t, 0, between_) : CVodeGetDky(memory_, t, 0, between_);
    State y;
    std::copy(NV_DATA_S(between_), NV_DATA_S(between_) + DIMENSION, y.begin());
    return y;
  }

  /// Goes on in the other regime if the last step ended on the surface.
  void change_regime() {
    if (!exit_) return;
    problem_.regime = 1 - problem_.regime;
    explicit_ ? ERKStepReset(memory_, time_, y_) : CVodeReInit(memory_, time_, y_);
    look_for_exit();
  }

 private:
  void look_for_exit() {
    int direction = problem_.regime ? 1 : -1;
    explicit_ ? ERKStepSetRootDirection(memory_, &direction)
              : CVodeSetRootDirection(memory_, &direction);
  }

  bool explicit_, exit_ = false;
  Problem problem_;
  SUNContext context_ = nullptr;
  N_Vector y_ = nullptr, between_ = nullptr;
  void *memory_ = nullptr;
  SUNMatrix matrix_ = nullptr;
  SUNLinearSolver linear_ = nullptr;
  SUNNonlinearSolver nonlinear_ = nullptr;
  realtype time_ = 0.0;
};

template <class End>
void follow(const Options &o, const Cantilever &c, const State &start, int periods, End end) {
  Solver solver(o, c, start);
  for (int k = 1; k <= periods; solver.change_regime()) {
    if (!solver.step(periods * c.period + 1.0)) {
      std::fprintf(stderr, "SUNDIALS gave up at %g\n", solver.time());
      std::exit(1);
    }
    for (; k <= periods && k * c.period <= solver.time(); k++)
      if (!end(k, solver.at(k * c.period))) return;
  }
}

}  // namespace

int main(int argc, char **argv) {
  return work_one_by_one(options_of(argc, argv),
                         [](const auto &...arguments) { follow(arguments...); });
}
