#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "host_tool/console/files.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/look/workbench.h"
#include "protocol/base/try.h"

namespace nodal::host::look {
namespace {

using Json = nlohmann::ordered_json;
using registration::Free;

constexpr std::size_t kLongestHistory = 100;  // steps that can be undone

tl::unexpected<Error> malformed(const std::string& what) {
  return fail(Errc::kBadValue, "The request lacks " + what + ".");
}

Result<double> number_of(const Json& words, const std::string& key) {
  const auto found = words.find(key);
  if (found == words.end() || !found->is_number() || !std::isfinite(found->get<double>()))
    return malformed("a number " + key);
  return found->get<double>();
}

Result<std::size_t> index_of(const Json& words, const std::string& key, std::size_t count) {
  const auto found = words.find(key);
  if (found == words.end() || !found->is_number_unsigned() || found->get<std::uint64_t>() >= count)
    return malformed(fmt::format("{}, a number below {}", key, count));
  return found->get<std::size_t>();
}

Result<Eigen::Vector3d> vector_of(const Json& words, const std::string& what) {
  Eigen::Vector3d vector(0, 0, 0);
  if (!words.is_array() || words.size() != 3) return malformed(what);
  for (std::size_t k = 0; k < 3; ++k) {
    if (!words[k].is_number() || !(std::abs(words[k].get<double>()) < 1e6)) return malformed(what);
    vector[static_cast<int>(k)] = words[k];
  }
  return vector;
}

Result<std::vector<Eigen::Vector3d>> directions_of(const Json& words) {
  const std::string what = "points, two or more directions";
  const auto found = words.find("points");
  if (found == words.end() || !found->is_array() || found->size() < 2 || found->size() > 1000) return malformed(what);
  std::vector<Eigen::Vector3d> all;
  for (const Json& each : *found) {
    NODAL_TRY_ASSIGN(const Eigen::Vector3d direction, vector_of(each, what));
    if (direction.norm() < 1e-6) return malformed(what);
    all.push_back(direction);
  }
  return all;
}

Result<std::vector<std::size_t>> heads_of(const Json& words, std::size_t count) {
  const auto found = words.find("heads");
  if (found == words.end() || !found->is_array() || found->empty()) return malformed("heads");
  std::vector<std::size_t> all;
  for (const Json& each : *found) {
    if (!each.is_number_unsigned() || each.get<std::uint64_t>() >= count) return malformed("heads that there are");
    all.push_back(each.get<std::size_t>());
  }
  std::ranges::sort(all);
  all.erase(std::ranges::unique(all).begin(), all.end());
  return all;
}

Result<registration::PointPair> pair_of(const Json& words, const std::vector<geometry::Head>& heads) {
  registration::PointPair pair;
  NODAL_TRY_ASSIGN(pair.head_a, index_of(words, "a", heads.size()));
  NODAL_TRY_ASSIGN(pair.head_b, index_of(words, "b", heads.size()));
  NODAL_TRY_ASSIGN(pair.pixel_a.x, number_of(words, "x"));
  NODAL_TRY_ASSIGN(pair.pixel_a.y, number_of(words, "y"));
  NODAL_TRY_ASSIGN(pair.pixel_b.x, number_of(words, "bx"));
  NODAL_TRY_ASSIGN(pair.pixel_b.y, number_of(words, "by"));
  if (pair.head_a == pair.head_b) return fail(Errc::kBadValue, "A pair is of two different heads.");
  for (const auto& [head, pixel] : {std::pair{pair.head_a, pair.pixel_a}, std::pair{pair.head_b, pair.pixel_b}}) {
    if (!heads[head].contains(pixel))
      return fail(Errc::kBadValue, fmt::format("Head {} shows nothing at this place.", heads[head].name()));
  }
  return pair;
}

/// The pixels at which a head sees the corners of a mask.
Result<std::vector<Region::Point>> mask_of(const Json& words, const geometry::Head& head) {
  NODAL_TRY_ASSIGN(const std::vector<Eigen::Vector3d> points, directions_of(words));
  if (points.size() < 3) return fail(Errc::kBadValue, "A mask has three corners or more.");
  std::vector<Region::Point> corners;
  for (const Eigen::Vector3d& point : points) {
    const auto pixel = head.project(geometry::Ray::towards(point.x(), -point.y(), -point.z()));
    if (!pixel) {
      return fail(Errc::kBadValue,
                  fmt::format("A corner of the mask is beyond what the lens of head {} sees; click nearer "
                              "to its picture.",
                              head.name()));
    }
    corners.push_back({pixel->x, pixel->y});
  }
  return corners;
}

Json report_json(const registration::Report& report) {
  Json heads = Json::array();
  for (const registration::HeadReport& head : report.heads) {
    heads.push_back({{"name", head.name},
                     {"placed", head.placed},
                     {"why_not", head.why_not},
                     {"turned_deg", head.turned_deg},
                     {"sigma_deg", std::isfinite(head.sigma_deg) ? Json(head.sigma_deg) : Json(nullptr)}});
  }
  return {{"heads", heads},
          {"levels_before", std::sqrt(report.objective_before)},
          {"levels_after", std::sqrt(report.objective_after)},
          {"warnings", report.warnings},
          {"error", ""}};
}

}  // namespace

void Workbench::add(Step step) {
  if (!steps_.empty()) steps_.resize(at_ + 1, steps_.front());
  // The first step stays: it is what all others are compared with.
  if (steps_.size() > kLongestHistory) steps_.erase(steps_.begin() + 1);
  steps_.push_back(std::move(step));
}

Answer Workbench::change(const Wanted& wanted) {
  if (wanted.name != "change") return Answer::text(404, "There is nothing of this name.");
  const Json words = Json::parse(wanted.body, nullptr, false);
  if (!words.is_object() || !words.contains("revision") || !words["revision"].is_number_unsigned() ||
      !words.contains("do") || !words["do"].is_string()) {
    return Answer::text(400, "The request lacks a revision and what to do.");
  }
  if (words["revision"].get<std::uint64_t>() != revision_)
    return Answer::text(409, "Another page changed the heads meanwhile; look at them, and do it again.");
  const std::string what = words["do"];
  const bool tries = what == "try" || what == "keep" || what == "drop";
  if (job_ != nullptr && what != "save" && !tries) return Answer::text(409, "A registration runs; wait for its end.");
  const auto done = [&]() -> Status {
    if (what == "undo" || what == "redo") {
      if (what == "undo" ? at_ == 0 : at_ + 1 == steps_.size())
        return fail(Errc::kBadValue, "There is nothing to " + what + ".");
      return go_to(what == "undo" ? at_ - 1 : at_ + 1);
    }
    if (what == "save") return save(words.value("replace", Json(false)) == Json(true));
    if (what == "register") return begin_registration(words);
    if (tries) return try_out(what);
    NODAL_TRY_ASSIGN(Step step, changed(what, words));
    NODAL_TRY(check_calibration(step.calibration));
    add(std::move(step));
    return go_to(steps_.size() - 1);
  }();
  if (done) return state();
  const Errc code = done.error().code;
  const bool conflict = code == Errc::kExists || code == Errc::kWrongState;
  const unsigned status = conflict ? 409 : code == Errc::kDiskFull ? 507 : code == Errc::kIo ? 500 : 400;
  return Answer::text(status, done.error().message);
}

Result<Workbench::Step> Workbench::changed(const std::string& what, const Json& words) const {
  Step step = now();
  if (what == "turn") {
    NODAL_TRY_ASSIGN(const std::vector<std::size_t> heads, heads_of(words, heads_.size()));
    NODAL_TRY_ASSIGN(const Eigen::Vector3d about, vector_of(words.value("about", Json()), "about, a rotation"));
    step.calibration = turned_by_hand(std::move(step.calibration), heads, about);
    return step;
  }
  if (what == "level" || what == "upright") {
    NODAL_TRY_ASSIGN(const std::vector<Eigen::Vector3d> points, directions_of(words));
    NODAL_TRY_ASSIGN(step.calibration,
                     what == "level" ? levelled(step.calibration, points) : upright(step.calibration, points));
    return step;
  }
  if (what == "mask" || what == "unmask") {
    NODAL_TRY_ASSIGN(const std::size_t head, index_of(words, "head", heads_.size()));
    auto& masks = step.calibration.heads[head].region.masks;
    if (what == "unmask") {
      masks.clear();
      return step;
    }
    NODAL_TRY_ASSIGN(std::vector<Region::Point> corners, mask_of(words, heads_[head]));
    masks.push_back(std::move(corners));
    return step;
  }
  Pairs pairs = *step.pairs;
  if (what == "add_pair") {
    if (pairs.size() >= options_.max_pairs)
      return fail(Errc::kTooLarge, fmt::format("There are {} pairs already; remove some.", pairs.size()));
    NODAL_TRY_ASSIGN(const registration::PointPair pair, pair_of(words, heads_));
    pairs.push_back(pair);
  } else if (what == "remove_pair") {
    NODAL_TRY_ASSIGN(const std::size_t index, index_of(words, "index", pairs.size()));
    pairs.erase(pairs.begin() + static_cast<std::ptrdiff_t>(index));
  } else if (what == "fit") {
    NODAL_TRY_ASSIGN(registration::PairFit fit, registration::fit_to_pairs(step.calibration, pairs, Free::kRotations));
    step.calibration = std::move(fit.calibration);
  } else {
    return fail(Errc::kBadValue, "There is nothing of this name to do.");
  }
  step.pairs = std::make_shared<const Pairs>(std::move(pairs));
  return step;
}

Status Workbench::begin_registration(const Json& words) {
  const std::map<std::string, Free> choices{
      {"rotations", Free::kRotations}, {"focals", Free::kFocals}, {"lens", Free::kLens}};
  const Json free = words.value("free", Json("rotations"));
  const auto choice = free.is_string() ? choices.find(free.get<std::string>()) : choices.end();
  if (choice == choices.end()) return malformed("free: rotations, focals or lens");
  std::size_t number = 0;
  if (words.contains("set")) {
    NODAL_TRY_ASSIGN(number, index_of(words, "set", pictures_->times().size()));
  }
  NODAL_TRY_ASSIGN(const std::shared_ptr<const HeadSet> set, pictures_->set(number));
  job_ = std::make_unique<Job>();
  job_->thread = std::thread([this, set, job = job_.get(), prior = now().calibration, wanted = choice->second] {
    registration::Options options;
    options.free = wanted;
    options.threads = options_.threads;
    options.gauge = options_.gauge;
    options.progress = [job](const registration::Step&, double share) { job->share = share; };
    job->report = registration::register_heads(prior, {set->frames()}, options);
    job->ended = true;
  });
  ++revision_;
  return {};
}

void Workbench::end_registration() {
  if (job_ == nullptr || !job_->ended) return;
  job_->thread.join();
  const Result<registration::Report> report = *std::move(job_->report);
  job_.reset();
  Json said = report ? report_json(*report) : Json{{"error", report.error().message}};
  if (report) {
    add({report->calibration, now().pairs});
    if (const Status made = go_to(steps_.size() - 1); !made) said["error"] = made.error().message;
  } else {
    ++revision_;
  }
  registered_ = std::make_shared<const Json>(std::move(said));
}

Status Workbench::save(bool replace) {
  if (replace) note_own(options_.out);
  NODAL_TRY(check_free(options_.out));
  NODAL_TRY(write_file(options_.out, to_json(now().calibration)));
  saved_ = options_.out;
  return {};
}

Status Workbench::try_out(const std::string& what) {
  if (trials_ == nullptr)
    return fail(Errc::kWrongState, "There is no rig to try it on; start `nodal look` with --rig.");
  if (what == "try") return trials_->begin(now().calibration);
  return trials_->end(what == "keep");
}

}  // namespace nodal::host::look
