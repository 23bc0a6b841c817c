#include "host_tool/look/workbench.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "host_tool/look/head_grid.h"
#include "host_tool/look/numbers.h"
#include "protocol/base/try.h"
#include "stitch/geometry/rotation.h"

namespace nodal::host::look {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kGridErrorDeg = 0.1;  // error of triangles
constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kProposedWithinDeg = 4, kRefinedWithinPx = 8;  // how far a proposal may be from where it begins
constexpr double kMinCorrelation = 0.6;                         // correlation below which nothing is proposed
constexpr std::size_t kMaxFitted = 2000;                        // pairs: a fit of more takes longer than people wait

/// In the axes of graphics.
Json axes_of(const Eigen::Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }

/// Rows of the rotation from a head's axes to the rig's, both as graphics have them.
Json rows_for_graphics(const HeadCalibration& head) {
  const Eigen::Matrix3d R = geometry::matrix_of(head.R_head_rig).transpose();
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      rows.push_back((row == 0 ? 1 : -1) * (column == 0 ? 1 : -1) * R(row, column));
  return rows;
}

/// The outlines of a head's masks as directions; edges are straight in the picture, so there are several an edge.
Json masks_json(const Region& region, const geometry::Head& head) {
  constexpr int kStepsAnEdge = 8;
  Json all = Json::array();
  for (const std::vector<Region::Point>& corners : region.masks) {
    Json outline = Json::array();
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const Region::Point &from = corners[k], &to = corners[(k + 1) % corners.size()];
      for (int step = 0; step < kStepsAnEdge; ++step) {
        const double share = double{1.0 * step} / kStepsAnEdge;
        const auto ray = head.unproject({from.x + share * (to.x - from.x), from.y + share * (to.y - from.y)});
        if (ray) outline.push_back(axes_of(ray->direction()));
      }
    }
    all.push_back(outline);
  }
  return all;
}

/// Of each pair: the rays of both heads, and the angle between them. `fit`: what the pairs would give; null: nothing.
Json pairs_json(const std::vector<registration::PointPair>& pairs, const std::vector<geometry::Head>& heads,
                const registration::PairFit* fit) {
  Json all = Json::array();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const registration::PointPair& pair = pairs[k];
    const auto a = heads[pair.head_a].unproject(pair.pixel_a), b = heads[pair.head_b].unproject(pair.pixel_b);
    Json json{{"a", pair.head_a},
              {"pixel_a", {pair.pixel_a.x, pair.pixel_a.y}},
              {"b", pair.head_b},
              {"pixel_b", {pair.pixel_b.x, pair.pixel_b.y}},
              {"outlier", fit != nullptr && !fit->used[k]}};
    if (a && b) {
      json["ray_a"] = axes_of(a->direction());
      json["ray_b"] = axes_of(b->direction());
      json["residual_deg"] = angle_between(*a, *b) * kDegrees;
    }
    all.push_back(json);
  }
  return all;
}

/// rms and worst residual of each two heads, as they are turned now, without outliers.
Json agreements_json(const Json& pairs) {
  struct Sum {
    double squares = 0, worst = 0;
    int count = 0;
  };
  std::map<std::pair<int, int>, Sum> sums;
  for (const Json& pair : pairs) {
    if (pair["outlier"] || !pair.contains("residual_deg")) continue;
    Sum& sum = sums[std::minmax(pair["a"].get<int>(), pair["b"].get<int>())];
    const double residual = pair["residual_deg"];
    sum.squares += residual * residual;
    sum.worst = std::max(sum.worst, residual);
    ++sum.count;
  }
  Json all = Json::array();
  for (const auto& [heads, sum] : sums) {
    all.push_back({{"a", heads.first},
                   {"b", heads.second},
                   {"pairs", sum.count},
                   {"rms_deg", std::sqrt(sum.squares / sum.count)},
                   {"worst_deg", sum.worst}});
  }
  return all;
}

/// The number of a set in a request, 0 if there is none in it; nothing if the set is not there.
std::optional<std::size_t> set_of(const Wanted& wanted, const HeadPictures& pictures) {
  if (!wanted.query.contains("set")) return 0;
  const auto set = whole_number(wanted, "set", 0, static_cast<int>(pictures.times().size()) - 1);
  return set ? std::optional(static_cast<std::size_t>(*set)) : std::nullopt;
}

}  // namespace

Workbench::Workbench(Options options) : options_(std::move(options)) {
  if (options_.connect) trials_ = std::make_unique<Trials>(options_.connect, options_.decide_within);
}

Result<std::unique_ptr<Workbench>> Workbench::make(RigPictures rig, Options options) {
  std::unique_ptr<Workbench> made(new Workbench(std::move(options)));
  made->notes_ = rig.notes;
  NODAL_TRY(check_calibration(rig.calibration));
  auto pictures = made->options_.take != nullptr ? HeadPictures::of(std::move(made->options_.take), rig.calibration)
                                                 : HeadPictures::of(rig);
  if (!pictures) return fail(pictures.error());
  made->pictures_ = std::move(*pictures);
  made->add({rig.calibration, std::make_shared<const Pairs>()});
  NODAL_TRY(made->go_to(0));
  for (std::size_t k = 0; k < made->heads_.size(); ++k) {
    NODAL_TRY_ASSIGN(HeadGrid grid, grid_of(made->heads_[k], kGridErrorDeg));
    made->errors_deg_.push_back(grid.error_deg);
    made->grids_.push_back(
        {200, "model/gltf-binary", std::make_shared<const std::vector<std::uint8_t>>(std::move(grid.glb))});
  }
  return made;
}

Workbench::~Workbench() {
  if (job_ != nullptr) job_->thread.join();
}

Status Workbench::go_to(std::size_t step) {
  NODAL_TRY_ASSIGN(heads_, geometry::make_heads(steps_[step].calibration));
  at_ = step;
  ++revision_;
  return {};
}

Answer Workbench::answer(const Wanted& wanted) {
  end_registration();
  if (wanted.changes) return change(wanted);
  if (wanted.name == "scene.json") return scene();
  if (wanted.name == "state.json") return state();
  if (wanted.name == "proposal") return proposal(wanted);
  if (wanted.name == "seen") return seen(wanted);
  if (wanted.name == "times.json") return steps_document(pictures_->times());
  if (wanted.name == "head") return head_picture(wanted);
  if (wanted.name != "grid.glb") return Answer::text(404, "There is nothing of this name.");
  const std::optional<int> head = whole_number(wanted, "head", 0, static_cast<int>(heads_.size()) - 1);
  return head ? grids_[static_cast<std::size_t>(*head)] : Answer::text(400, "There is no such head.");
}

Answer Workbench::scene() const {
  Json heads = Json::array();
  for (std::size_t k = 0; k < heads_.size(); ++k) {
    heads.push_back({{"name", heads_[k].name()},
                     {"width", heads_[k].width()},
                     {"height", heads_[k].height()},
                     {"error_deg", errors_deg_[k]}});
  }
  return document({{"name", options_.name},
                   {"notes", notes_},
                   {"out", options_.out},
                   {"pictures", pictures_->times().size()},
                   {"rig", trials_ == nullptr ? Json(nullptr) : Json(options_.rig)},
                   {"heads", heads}});
}

Answer Workbench::head_picture(const Wanted& wanted) {
  const std::optional<int> head = whole_number(wanted, "head", 0, static_cast<int>(heads_.size()) - 1);
  const std::optional<int> side = whole_number(wanted, "side", kSmallestSide, kLargestSide);
  const std::optional<std::size_t> set = set_of(wanted, *pictures_);
  if (!head) return Answer::text(400, "There is no such head.");
  if (!side) return Answer::text(400, fmt::format("Give side={} to {}.", kSmallestSide, kLargestSide));
  if (!set) return Answer::text(400, "There is no such set.");
  auto bytes = pictures_->jpeg(*set, static_cast<std::size_t>(*head), *side);
  if (!bytes) return Answer::text(500, bytes.error().message);
  return {200, "image/jpeg", std::make_shared<const std::vector<std::uint8_t>>(*std::move(bytes))};
}

Answer Workbench::state() const {
  const Pairs& pairs = *now().pairs;
  std::optional<registration::PairFit> fit;
  if (pairs.size() >= 4 && pairs.size() <= kMaxFitted) {
    auto made = registration::fit_to_pairs(now().calibration, pairs, registration::Free::kRotations);
    if (made) fit = *std::move(made);
  }
  Json heads = Json::array();
  for (std::size_t k = 0; k < heads_.size(); ++k) {
    const HeadCalibration &head = now().calibration.heads[k], &first = steps_.front().calibration.heads[k];
    const geometry::YawPitchRoll is = geometry::to_yaw_pitch_roll(geometry::matrix_of(head.R_head_rig));
    const Eigen::Matrix3d turned =
        geometry::matrix_of(head.R_head_rig) * geometry::matrix_of(first.R_head_rig).transpose();
    const Eigen::Vector3d twice(turned(2, 1) - turned(1, 2), turned(0, 2) - turned(2, 0), turned(1, 0) - turned(0, 1));
    heads.push_back({{"name", head.name},
                     {"axes", rows_for_graphics(head)},
                     {"masks", masks_json(head.region, heads_[k])},
                     {"yaw", is.yaw},
                     {"pitch", is.pitch},
                     {"roll", is.roll},
                     {"turned_deg", std::atan2(twice.norm(), turned.trace() - 1) * kDegrees}});
  }
  const Json all = pairs_json(pairs, heads_, fit ? &*fit : nullptr);
  return document({{"revision", revision_},
                   {"undo", at_ > 0},
                   {"redo", at_ + 1 < steps_.size()},
                   {"heads", heads},
                   {"pairs", all},
                   {"agreements", agreements_json(all)},
                   {"fitted_rms_deg", fit ? Json(fit->rms_deg) : Json(nullptr)},
                   {"registering", job_ == nullptr ? Json(nullptr) : Json(job_->share.load())},
                   {"registered", registered_ == nullptr ? Json(nullptr) : *registered_},
                   {"trial", trials_ == nullptr ? Json(nullptr) : trials_->state()},
                   {"saved", saved_}});
}

Answer Workbench::proposal(const Wanted& wanted) {
  const int last = static_cast<int>(heads_.size()) - 1;
  const auto a = whole_number(wanted, "a", 0, last), b = whole_number(wanted, "b", 0, last);
  const auto x = number(wanted, "x"), y = number(wanted, "y"), bx = number(wanted, "bx"), by = number(wanted, "by");
  if (!a || !b || *a == *b || !x || !y) return Answer::text(400, "Give two heads a and b, and a pixel x, y of head a.");
  const std::optional<std::size_t> set = set_of(wanted, *pictures_);
  if (!set) return Answer::text(400, "There is no such set.");
  const auto shown = pictures_->set(*set);
  if (!shown) return Answer::text(500, shown.error().message);
  const auto seen_by = [&](int k) {
    return SeenBy{heads_[static_cast<std::size_t>(k)], (*shown)->grey[static_cast<std::size_t>(k)]};
  };
  const std::optional<geometry::Pixel> near = bx && by ? std::optional(geometry::Pixel{*bx, *by}) : std::nullopt;
  const double density = seen_by(*a).head.density({*x, *y});
  const double within = near ? kRefinedWithinPx : kProposedWithinDeg / kDegrees * std::sqrt(std::max(0.0, density));
  const std::optional<Found> found = find_again(seen_by(*a), {*x, *y}, seen_by(*b), near, within);
  if (!found || found->correlation < kMinCorrelation) {
    return document({{"found", false},
                     {"why", fmt::format("Head {} shows nothing that looks like this place; click the place there, or "
                                         "choose one with more detail.",
                                         seen_by(*b).head.name())}});
  }
  return document({{"found", true}, {"x", found->pixel.x}, {"y", found->pixel.y}, {"correlation", found->correlation}});
}

Answer Workbench::seen(const Wanted& wanted) const {
  const auto x = number(wanted, "x"), y = number(wanted, "y"), z = number(wanted, "z");
  if (!x || !y || !z || *x * *x + *y * *y + *z * *z < 1e-12) return Answer::text(400, "Give a direction x, y, z.");
  const geometry::Ray ray = geometry::Ray::towards(*x, -*y, -*z);
  Json all = Json::array();
  for (std::size_t k = 0; k < heads_.size(); ++k) {
    const std::optional<geometry::Pixel> pixel = heads_[k].pixel_of(ray);
    if (!pixel) continue;
    all.push_back({{"head", k}, {"x", pixel->x}, {"y", pixel->y}, {"edge_px", heads_[k].distance_to_edge(*pixel)}});
  }
  return document(all);
}

}  // namespace nodal::host::look
