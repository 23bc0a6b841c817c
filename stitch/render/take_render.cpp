#include "stitch/render/take_render.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <string>
#include <utility>

#include "protocol/base/raymap_rate.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"
#include "protocol/take/seam_map.h"
#include "protocol/take/tally.h"
#include "stitch/decode/frame_decoder.h"
#include "stitch/render/raymap_times.h"
#include "stitch/sets/plan_job.h"
#include "stitch/sets/raymap_toml.h"
#include "stitch/sets/rig_heads.h"

namespace nodal::render {
namespace {

constexpr std::size_t kMaxTomlBytes = std::size_t{1} << 20;

sets::SetFrame blended(const media::TakeFrame& frame) {
  return {frame.present, frame.image, frame.fields, frame.exposure, frame.gain, frame.gamma};
}

}  // namespace

Result<RaymapConfig> raymap_of(const media::TakeFolder& folder) {
  NODAL_TRY_ASSIGN(const auto text, folder.text(take::kRigFile, kMaxTomlBytes));
  const auto read = [&](const std::string& file) { return folder.text(file, kMaxRayFileBytes); };
  return sets::raymap_config_of(text, folder.shown(take::kRigFile), read);
}

TakeRender::TakeRender(const media::TakeFolder& folder, RenderOptions options, std::vector<Used> calibrations)
    : folder_(folder),
      options_(std::move(options)),
      calibrations_(std::move(calibrations)),
      used_(&calibrations_.front()),
      workers_(options_.threads),
      sets_(folder) {}

Result<std::unique_ptr<TakeRender>> TakeRender::make(const media::TakeFolder& folder, RenderOptions options) {
  std::vector<sets::RigHead> named;
  for (const std::string& head : folder.about().heads) named.push_back({head, {}});
  std::vector<Used> calibrations;
  const auto add = [&](Calibration calibration, std::uint64_t first_set, const std::string& from) -> Status {
    if (const auto fits = sets::calibration_of(calibration, named, "take.json"); !fits)
      return fail(fits.error().in(from));
    const Sha256 id = calibration_id(calibration);
    calibrations.push_back({std::move(calibration), id, first_set, true});
    return {};
  };
  const auto add_file = [&](const std::string& name, std::uint64_t first_set) -> Status {
    NODAL_TRY_ASSIGN(const auto text, folder.text(name, kMaxCalibrationBytes));
    auto parsed = parse_calibration(text);
    if (!parsed) return fail(parsed.error().in(folder.shown(name)));
    return add(std::move(*parsed), first_set, folder.shown(name));
  };
  Status added;
  if (options.calibration) {
    added = add(*options.calibration, 0, "--calibration");
  } else {
    const auto& later = folder.manifest().calibrations;
    if (folder.has(take::kCalibrationFile)) added = add_file(take::kCalibrationFile, 0);
    for (std::size_t k = 0; k < later.size() && added; ++k) {
      if (later[k].stored()) added = add_file(later[k].file, later[k].set);
      else calibrations.push_back({{}, {}, later[k].set, false});
    }
    if (added && calibrations.empty()) {
      return fail(Errc::kNotReady,
                  folder.shown(take::kCalibrationFile) + ": the take has no calibration; give one with --calibration");
    }
  }
  if (!added) return fail(added.error());
  const bool given = options.calibration.has_value();
  auto made = std::unique_ptr<TakeRender>(new TakeRender(folder, std::move(options), std::move(calibrations)));
  if (given) {
    const std::string id = to_hex(made->used_->id);
    made->of_take_ = id == folder.about().calibration_id ||
                     std::ranges::count(folder.manifest().calibrations, id, &take::Manifest::Calibration::id) > 0;
  }
  return made;
}

std::vector<const Calibration*> TakeRender::calibrations() const {
  std::vector<const Calibration*> all;
  for (const Used& used : calibrations_) all.push_back(&used.calibration);
  return all;
}

Result<bool> TakeRender::next(RenderedRaymap& into, const std::function<void(double)>& compiled) {
  if (next_field_ == 0) {
    const Result<bool> got = next_set(compiled);
    if (!got || !*got) return got;
    if (std::exchange(seek_.second_field, false)) next_field_ = 1;
  }
  blend(into);
  next_field_ = (next_field_ + 1) % blend_.plan()->tables.size();
  return true;
}

Result<bool> TakeRender::next_set(const std::function<void(double)>& compiled) {
  std::array<sets::SetFrame, kMaxHeads> before{};  // the settings of heads in the sets that are not rendered
  for (;; ++seek_.next_set) {
    const Result<bool> more = sets_.next(set_);
    if (!more || !*more) return more;
    if (!first_) first_ = set_.mid_exposure;
    const Duration since = set_.mid_exposure - *first_;
    if (since >= options_.to) return false;
    if (since >= options_.from && seek_.next_set >= seek_.first_set) break;
    for (std::size_t i = 0; i < before.size(); ++i) {
      if (set_.heads[i].present) before[i] = blended(set_.heads[i]);
    }
  }
  ++seek_.next_set;
  NODAL_TRY(use_tables(compiled));
  NODAL_TRY(sets_.read_pictures(set_));
  const std::uint64_t number = set_.evidence.number();
  if (has_seams()) {
    NODAL_TRY(use_seams());
  } else if (given_) {
    NODAL_TRY(use_given_seams());
  } else if (seams_.due(number)) {
    if (sets::PlanPtr plan = seams_.take().plan) blend_.move_seams(std::move(plan));
  }
  blend_.note_exposures(before);
  const bool places = blend_.plan()->seams && !has_seams() && !given_ && seams_.wants(number);
  begin_set(places);
  if (places && blend_.views()) NODAL_TRY(place_seams(number));
  return true;
}

void TakeRender::seek(std::uint64_t raymap, std::vector<std::uint8_t> seams) {
  const auto a_set = static_cast<std::uint64_t>(options_.raymap.raymaps_a_set());
  sets_.restart();
  seek_ = {raymap / a_set, 0, raymap % a_set != 0};
  next_field_ = 0;
  used_ = &calibrations_.front();
  segment_.reset();
  seams_ = {};
  given_ = std::move(seams);
  blend_ = {};  // it keeps exposures of later sets
  if (own_seams_) blend_.adopt(sets::with_memory(own_seams_));
}

Result<std::vector<std::uint8_t>> TakeRender::suitable_seams(std::uint64_t raymap, std::vector<std::uint8_t> before) {
  seek(raymap, std::move(before));
  NODAL_TRY_ASSIGN(const bool more, next_set({}));
  if (!more || !blend_.plan()->seams || has_seams()) return std::vector<std::uint8_t>{};
  begin_set(true);
  if (!blend_.views()) return std::vector<std::uint8_t>{};
  const sets::PlacedSeams placed = sets::place_seams(*blend_.plan(), *blend_.views());
  if (!placed.refused.empty()) return fail(Errc::kTableInvalid, "placing seams: " + placed.refused);
  if (!placed.plan || !placed.plan->seam_labels) return std::vector<std::uint8_t>{};
  return *placed.plan->seam_labels;
}

Status TakeRender::use_given_seams() {
  const sets::SeamLabels& now = blend_.plan()->seam_labels;
  if (given_->empty() || !blend_.plan()->seams || (now && *now == *given_)) return {};
  NODAL_TRY_ASSIGN(auto seamed, sets::with_seams(*blend_.plan(), *given_));
  blend_.move_seams(std::move(seamed));
  return {};
}

/// Whether the rig recorded with which seams it blended the segment, with the take's calibration.
bool TakeRender::has_seams() {
  return blend_.plan()->seams && !options_.calibration && !sets_.segment().evidence().seams.empty();
}

/// Puts the recorded seams of a set in force.
Status TakeRender::use_seams() {
  const take::wire::Seams* const seams = sets_.segment().evidence().seams_at(set_.evidence.number());
  const std::optional<std::uint64_t> from = seams ? std::optional(seams->set()) : std::nullopt;
  if (!seams_.follow(from)) return {};
  if (!seams || seams->columns() == 0) {
    blend_.move_seams(own_seams_);
    return {};
  }
  const auto in_take = [&](const Error& error) {
    return fail(error.in(fmt::format("the seams from set {} on", *from))
                    .in(folder_.shown(take::evidence_file(sets_.segment().evidence().begin.segment()))));
  };
  if (seams->columns() != sets::kSeamMapWidth) {
    return in_take({Errc::kUnsupported, fmt::format("their map has {} columns; this program reads {}", seams->columns(),
                                                    sets::kSeamMapWidth)});
  }
  auto labels = take::labels_of(*seams);
  if (!labels) return in_take(labels.error());
  auto seamed = sets::with_seams(*blend_.plan(), std::move(*labels));
  if (!seamed) return in_take(seamed.error());
  blend_.move_seams(std::move(*seamed));
  return {};
}

/// From the first set of each period, as a rig does that is not overloaded.
Status TakeRender::place_seams(std::uint64_t set) {
  seams_.begin(set);
  sets::PlacedSeams placed = sets::place_seams(*blend_.plan(), *blend_.views());
  if (!placed.refused.empty()) return fail(Errc::kTableInvalid, "placing seams: " + placed.refused);
  seams_.placed(std::move(placed));
  return {};
}

/// Compiles tables for a set's calibration and for the heads' formats in its segment, if they are not those of the set
/// before.
Status TakeRender::use_tables(const std::function<void(double)>& compiled) {
  const take::wire::Begin& begin = sets_.segment().evidence().begin;
  while (used_ != &calibrations_.back() && (used_ + 1)->first_set <= set_.evidence.number()) ++used_;
  if (segment_ == begin.segment() && compiled_ == used_) return {};
  if (!used_->stored) {
    return fail(Errc::kNotReady,
                fmt::format("{}: the calibrations from the rig's set {} on are not in the take, because it has as many "
                            "as it can have; render the sets before with --to, or give one with --calibration",
                            folder_.shown(take::kManifestFile), used_->first_set));
  }
  segment_ = begin.segment();

  std::vector<sets::RigHead> heads;
  for (const std::string& name : folder_.about().heads) heads.push_back({name, {}});
  // Of a head without a picture in the segment no format is known, and none matters.
  const std::vector<take::StreamFile>& files = sets_.segment().streams();
  std::vector<PixelFormat> formats(heads.size(), PixelFormat::kI420);
  std::optional<Fields> fields;
  for (const take::StreamFile& file : files) {
    if (!file.head) continue;
    if (!fields) formats.assign(heads.size(), file.stream.format), fields = file.stream.fields;
  }
  for (const take::StreamFile& file : files) {
    if (!file.head) continue;
    formats[*file.head] = file.stream.format;
    heads[*file.head].size = {file.stream.width, file.stream.height};
  }
  if (compiled_ == used_ && formats == formats_ && fields == fields_) return {};
  NODAL_TRY_ASSIGN(const auto fitted, sets::calibration_of(used_->calibration, heads, "take.json"));
  NODAL_TRY_ASSIGN(auto job,
                   sets::PlanJob::make(fitted, options_.raymap, fields.value_or(Fields::kProgressive), formats));
  while (!job.tables().done()) {
    job.tables().compile_pieces(2 * workers_.threads(),
                                [this](int pieces, const auto& work) { workers_.run(pieces, work); });
    if (compiled) compiled(job.tables().percent() / 100.0);
  }
  NODAL_TRY_ASSIGN(auto plan, std::move(job).finish(used_->id));
  own_seams_ = plan;
  blend_.adopt(sets::with_memory(std::move(plan)));
  seams_ = {};
  compiled_ = used_;
  formats_ = std::move(formats);
  fields_ = fields;
  return {};
}

void TakeRender::begin_set(bool views) {
  std::array<sets::SetFrame, kMaxHeads> frames;
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i] = blended(set_.heads[i]);
  blend_.begin(frames, views);
  run_rounds();
  const auto is_fault = [](const auto& frame) { return frame.fault != decode::DecodeFault::kNone; };
  undecodable_ = static_cast<std::size_t>(std::ranges::count_if(blend_.decoded(), is_fault));
}

void TakeRender::run_rounds() {
  blend_.run_rounds([this](int pieces, const auto& work) { workers_.run(pieces, work); });
}

std::optional<FrameRate> TakeRender::rate() {
  const FrameRate sets = take::rate_of(sets_.segment().evidence().begin, folder_.about().rate);
  return raymap_rate(sets, options_.raymap.raymaps_a_set());
}

void TakeRender::blend(RenderedRaymap& into) {
  const RaymapConfig& raymap = options_.raymap;
  into.pixels.format = raymap.format;
  into.pixels.width = raymap.width;
  into.pixels.height = raymap.height;
  into.pixels.bytes.resize(packed_size(raymap.format, raymap.width, raymap.height));
  blend_.begin_raymap(next_field_, into.pixels.bytes.data());
  run_rounds();
  into.mid_exposure = set_.mid_exposure;
  into.heads = blend_.heads();
  into.linear = blend_.linear();
  into.field.reset();
  into.undecodable_heads = undecodable_;
  if (const auto parity = blend_.table().sources[0].field) {
    into.field = static_cast<int>(next_field_);
    into.parity = *parity;
    if (next_field_ == 1)
      into.mid_exposure = set_.mid_exposure + second_field(sets_.segment().evidence().begin, folder_.about().rate);
  }
}

}  // namespace nodal::render
