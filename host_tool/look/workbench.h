// Heads that people place by hand: what the page shows of them, and each change as a request.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host_tool/input/rig_pictures.h"
#include "host_tool/look/head_pictures.h"
#include "host_tool/look/server.h"
#include "host_tool/look/trials.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/head.h"
#include "stitch/registration/pairs.h"
#include "stitch/registration/registration.h"

namespace nodal::host::look {

/// Answers to GET:
///   scene.json                     the heads: names, sizes, how far their triangles may be off
///   grid.glb?head=K                a head's picture as triangles in its own axes, as glTF
///   head?head=K&side=N&set=S       its picture of a set (the first without S), JPEG, its longer side at most N px
///   times.json                     of a take: ms from each set to the next
///   state.json                     rotations, pairs and their residuals, what can be undone, the running registration
///   proposal?a=K&x=X&y=Y&b=L       where head L shows what is at a pixel of head K; with bx, by: refined from there;
///                                  with set=S, in the pictures of that set
///   seen?x=X&y=Y&z=Z               the pixels of the heads that see a direction
/// Answers to POST "change", whose body is {"revision": N, "do": WHAT, ...}; the answer is the new state:
///   turn {heads, about}            heads by |about| rad about it
///   level {points}                 two or more directions on the horizon
///   upright {points}               two or more directions on one vertical line
///   add_pair {a, x, y, b, bx, by}, remove_pair {index}
///   mask {head, points}            a polygon of three or more directions, which the head is not used for
///   unmask {head}                  without any
///   fit                            rotations by the pairs
///   register {free, set}           "rotations", "focals" or "lens": by the pictures of a set, on a thread of its own
///   undo, redo
///   save {replace}                 the calibration, to the file of the command line
///   try, keep, drop                the calibration on trial on the rig, and its end (Trials)
/// Directions and rotations are in the axes of graphics: x right, y up, z backward. A request that was made on another
/// revision than the newest is answered by 409 and changes nothing: two pages may be open.
///
/// Threading: thread-bound to the server's thread, but for the registration's own.
/// Ownership: owns the pictures; the destructor waits for a registration that runs, and drops what is on trial.
class Workbench {
 public:
  struct Options {
    std::string name;  ///< what is shown, for people
    std::string out;   ///< the file that "save" writes
    int threads = 0;
    std::size_t max_pairs = 10'000;
    std::unique_ptr<TakeHeads> take{};  ///< its sets; null: the first set of the pictures
    registration::Gauge gauge = registration::Gauge::kFirstHead;
    std::string rig{};                               ///< the address of a rig that calibrations are tried on
    Reconnect connect{};                             ///< to it; empty: there is none
    Duration decide_within = Trials::kDecideWithin;  ///< limit of a trial
  };
  /// Errors: those of HeadPictures, make_heads() and grid_of().
  static Result<std::unique_ptr<Workbench>> make(RigPictures rig, Options options);
  ~Workbench();
  Workbench(const Workbench&) = delete;
  Workbench& operator=(const Workbench&) = delete;

  Answer answer(const Wanted& wanted);

 private:
  using Pairs = std::vector<registration::PointPair>;
  struct Step {
    Calibration calibration;
    std::shared_ptr<const Pairs> pairs;
  };
  /// What a registration says of itself while it runs, and after it.
  struct Job {
    std::thread thread;
    std::atomic<double> share{0};
    std::atomic<bool> ended{false};
    std::optional<Result<registration::Report>> report;
  };

  explicit Workbench(Options options);
  Answer change(const Wanted& wanted);
  Result<Step> changed(const std::string& what, const nlohmann::ordered_json& words) const;
  Status begin_registration(const nlohmann::ordered_json& words);
  void end_registration();
  Status save(bool replace);
  Status try_out(const std::string& what);
  Status go_to(std::size_t step);
  void add(Step step);
  Answer scene() const;
  Answer state() const;
  Answer head_picture(const Wanted& wanted);
  Answer proposal(const Wanted& wanted);
  Answer seen(const Wanted& wanted) const;
  const Step& now() const { return steps_[at_]; }

  Options options_;
  std::unique_ptr<HeadPictures> pictures_;
  std::unique_ptr<Trials> trials_;  ///< null: there is no rig
  std::vector<Answer> grids_;
  std::vector<double> errors_deg_;
  std::vector<std::string> notes_;
  std::vector<Step> steps_;  ///< what was done; steps after `at_` were undone
  std::size_t at_ = 0;
  std::uint64_t revision_ = 0;
  std::vector<geometry::Head> heads_;  ///< those of now()
  std::unique_ptr<Job> job_;
  std::shared_ptr<const nlohmann::ordered_json> registered_;  ///< what the last registration says; null: there was none
  std::string saved_;                                         ///< the name of the file that was saved last
};

/// The change of a calibration that turns heads. `about`: in the axes of graphics, rad.
Calibration turned_by_hand(Calibration calibration, const std::vector<std::size_t>& heads,
                           const Eigen::Vector3d& about);
/// The rig turned as little as possible so that directions lie on the horizon, or on one vertical line. In the axes of
/// graphics. Errors: kBadValue for directions that do not determine it.
Result<Calibration> levelled(const Calibration& calibration, const std::vector<Eigen::Vector3d>& horizon);
Result<Calibration> upright(const Calibration& calibration, const std::vector<Eigen::Vector3d>& vertical);

}  // namespace nodal::host::look
