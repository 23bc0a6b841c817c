// One run of registration: its levels from coarse to fine, the placed heads, the report.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stitch/parallel/workers.h"
#include "stitch/registration/certainty.h"
#include "stitch/registration/head_state.h"
#include "stitch/registration/level.h"
#include "stitch/registration/observability.h"
#include "stitch/registration/pyramid.h"
#include "stitch/registration/registration.h"
#include "stitch/registration/run_plan.h"
#include "stitch/registration/search.h"

namespace nodal::registration {

/// Huber's norm becomes linear at this share of the rms difference at the start of a level.
inline constexpr double kHuberShare = 1.0;
/// Heads that share a smaller solid angle are not checked for alignment.
inline constexpr double kSmallOverlapSr = 0.02;

/// Why heads do not agree everywhere.
enum class Cause : std::uint8_t { kNone, kNearThings, kFocals, kLenses };

/// The heads without a reason not to be placed.
std::vector<bool> placed_heads(const std::vector<std::string>& why_not);

/// Threading: thread-bound; starts threads of its own. Ownership: the prior outlives it. Errors: as register_heads().
class Run {
 public:
  Run(const Calibration& prior, const Options& options) : prior_(prior), options_(options), workers_(options.threads) {}

  /// Before run(): the head keeps the prior's rotation, for this reason.
  void leave_out(std::size_t head, std::string why);
  Result<Report> run(const LitFrames& frames);
  /// The heads that disagreed with the others when run() failed.
  const std::vector<std::size_t>& wrong() const { return agreement_.wrong; }
  /// Whether one of them shows much less detail than the other heads, as out of focus.
  bool little_detail(std::size_t head) const { return agreement_.little_detail[head]; }
  /// The correlation of one's detail with what the others show there.
  double agreement(std::size_t head) const { return agreement_.of_head[head]; }
  /// The cause that run() found, if it got as far as its report; also if that failed because of wrong lenses.
  Cause cause() const { return cause_; }
  /// Certainty::parts_px of the result.
  double displaced_px() const { return displaced_px_; }
  /// The final objective, levels squared; also after a run() that failed because of its lenses.
  double objective_after() const { return report_.objective_after; }

 private:
  Status prepare(const LitFrames& frames);
  Status find_dull_heads();
  Status check_agreement();
  Status descend_level(const LevelPlan& plan);
  Status descend_coarse();
  Status check_rivals();
  Status descend_fine();
  Status choose_valley(std::size_t first, std::size_t last);
  Status check_placed(bool& changed);
  Status light_unplaced_heads();
  Result<Certainty> certainty(Level& level, const LevelPlan& plan) const;
  /// Another result, with other parameters estimated.
  struct Alternative {
    double by_parts = 0;  ///< see Certainty
    std::vector<HeadState> heads;
  };
  Result<Alternative> attempt(bool lenses, bool distance);
  struct Explanation {
    Cause cause = Cause::kNone;
    double nearness = 0;        ///< nearness of near things, if one distance explains most, 1/m
    std::vector<double> turns;  ///< how far alternatives turn each head, rad; empty without alternatives
  };
  Explanation explained(const Certainty& certainty);
  Result<Explanation> check_cause(const Certainty& certainty);
  Result<Report> report();

  const Calibration& prior_;
  Options options_;
  double huber_share_ = kHuberShare;
  parallel::Workers workers_;
  LitFrames frames_;
  std::vector<HeadState> start_, heads_;
  std::vector<LevelPlan> plans_;
  std::vector<bool> own_vignetting_;
  std::vector<std::string> why_not_;  // empty: placed
  std::vector<double> loose_sigma_;   // rad; by head, infinite if not placed
  /// What the latest check_agreement() found.
  struct Agreement {
    std::vector<std::size_t> wrong;  // heads that disagree
    std::ptrdiff_t apart = 0;        // pairs of heads whose common detail does not agree
    std::vector<double> of_head;
    std::vector<bool> little_detail;  // heads with much less detail than the others
    struct CoarseSigma {
      double rad = 0;
      double per_radian = 0;  // pixels of the level
    };
    // By head, from the finest level on which it agrees with others.
    std::vector<std::optional<CoarseSigma>> coarse_sigma;
  };
  Agreement agreement_;
  std::optional<Rival> rival_;  // another rotation that may be right
  Cause cause_ = Cause::kNone;
  double displaced_px_ = 0;
  bool soft_priors_ = true;  // the lenses have soft priors
  std::vector<bool> loose_;  // heads whose detail does not determine their rotation
  float huber_ = 0;          // Huber's threshold on the latest level
  Report report_;
  RunWork work_;
};

}  // namespace nodal::registration
