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
#include "host_tool/look/correlation.h"
#include "host_tool/look/server.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/head.h"
#include "stitch/registration/pairs.h"
#include "stitch/registration/registration.h"

namespace nodal::host::look {

/// Answers to GET:
///   scene.json                     the heads: names, sizes, how far their triangles may be off
///   grid.glb?head=K                a head's picture as triangles in its own axes, as glTF
///   head?head=K&side=N             its picture, JPEG, its longer side at most N px
///   state.json                     rotations, pairs and their residuals, what can be undone, the running registration
///   proposal?a=K&x=X&y=Y&b=L       where head L shows what is at a pixel of head K; with bx, by: refined from there
///   seen?x=X&y=Y&z=Z               the pixels of the heads that see a direction
/// Answers to POST "change", whose body is {"revision": N, "do": WHAT, ...}; the answer is the new state:
///   turn {heads, about}            heads by |about| rad about it
///   level {points}                 two or more directions on the horizon
///   upright {points}               two or more directions on one vertical line
///   add_pair {a, x, y, b, bx, by}, remove_pair {index}
///   mask {head, points}            a polygon of three or more directions, which the head is not used for
///   unmask {head}                  without any
///   fit                            rotations by the pairs
///   register {free}                "rotations", "focals" or "lens": by the pictures, on a thread of its own
///   undo, redo
///   save {replace}                 the calibration, to the file of the command line
/// Directions and rotations are in the axes of graphics: x right, y up, z backward. A request that was made on another
/// revision than the newest is answered by 409 and changes nothing: two pages may be open.
///
/// Threading: thread-bound to the server's thread, but for the registration's own.
/// Ownership: owns the pictures; the destructor waits for a registration that runs.
class Workbench {
 public:
  struct Options {
    std::string name;  ///< what is shown, for people
    std::string out;   ///< the file that "save" writes
    int threads = 0;
  };
  /// The first set of the pictures. Errors: those of decode_all(), make_heads() and grid_of().
  static Result<std::unique_ptr<Workbench>> make(RigPictures rig, const Options& options);
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

  explicit Workbench(Options options) : options_(std::move(options)) {}
  Answer change(const Wanted& wanted);
  Result<Step> changed(const std::string& what, const nlohmann::ordered_json& words) const;
  Status begin_registration(const nlohmann::ordered_json& words);
  void end_registration();
  Status save(bool replace);
  Status go_to(std::size_t step);
  void add(Step step);
  Answer scene() const;
  Answer state() const;
  Answer head_picture(std::size_t head, int side) const;
  Answer proposal(const Wanted& wanted) const;
  Answer seen(const Wanted& wanted) const;
  const Step& now() const { return steps_[at_]; }

  Options options_;
  std::vector<DecodedImage> pictures_;  ///< one a head
  std::vector<GreyPyramid> grey_;
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
