#include "host_tool/film/heads_source.h"

#include <fmt/format.h>

#include <utility>

#include "protocol/base/try.h"

namespace nodal::film {

Result<std::unique_ptr<HeadsSource>> HeadsSource::make(const FilmPlan& plan, const Programs& programs, int threads,
                                                       const std::function<void(double)>& progress) {
  NODAL_TRY_ASSIGN(FilmBlend blend, FilmBlend::make(plan, threads, progress));
  return std::unique_ptr<HeadsSource>(new HeadsSource(plan, programs, std::move(blend)));
}

Status HeadsSource::open_heads() {
  for (std::size_t h = 0; h < heads_.size(); ++h) replaced_[h] += heads_[h]->replaced();
  heads_.clear();
  for (const PlannedHead& head : plan_.heads) {
    NODAL_TRY_ASSIGN(auto film, HeadFilm::open(programs_, head.film, head.times[frame_]));
    heads_.push_back(std::move(film));
  }
  return {};
}

/// Whether seeking to the next frame takes less time than decoding all frames up to it.
bool HeadsSource::is_far() const {
  constexpr double kFar = 1.5;  // s; a decoder that seeks begins at a key frame, which may be so far back
  const PlannedHead& head = plan_.heads.front();
  return frame_ > begin_ && seconds_of(head.times[frame_] - head.times[frame_ - 1], head.film.time_base) > kFar;
}

Result<std::vector<ImageView>> HeadsSource::pictures() {
  std::vector<ImageView> pictures;
  std::vector<Stops> light;
  for (std::size_t h = 0; h < plan_.light.stops.size(); ++h) light.push_back(plan_.light.at(h, frame_));
  blend_.set_light(std::move(light));
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    NODAL_TRY_ASSIGN(const ImageView picture, heads_[h]->at(plan_.heads[h].times[frame_]));
    pictures.push_back(picture);
  }
  return pictures;
}

Status HeadsSource::begin(std::uint64_t segment) {
  begin_ = frame_ = plan_.begin_of(segment);
  NODAL_TRY(blend_.use(plan_.seams_at(segment)));
  replaced_.assign(plan_.heads.size(), 0);
  return open_heads();
}

Status HeadsSource::next(std::span<std::uint8_t> into) {
  if (is_far()) NODAL_TRY(open_heads());
  NODAL_TRY_ASSIGN(const auto now, pictures());
  blend_.blend(now, into.data());
  ++frame_;
  return {};
}

std::vector<std::string> HeadsSource::finish() {
  std::vector<std::string> notes;
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    const std::uint64_t replaced = replaced_[h] + heads_[h]->replaced();
    const std::string complaint = heads_[h]->finish();
    if (replaced == 0) continue;
    notes.push_back(
        fmt::format("{}: {} of frames {} to {} cannot be decoded, and the ones before are shown instead{}{}",
                    plan_.heads[h].film.path, replaced, begin_, frame_ - 1, complaint.empty() ? "" : ": ", complaint));
  }
  heads_.clear();
  return notes;
}

Result<std::vector<std::uint8_t>> HeadsSource::place_seams(std::uint64_t segment) {
  begin_ = frame_ = plan_.begin_of(segment);
  replaced_.assign(plan_.heads.size(), 0);
  NODAL_TRY(open_heads());
  NODAL_TRY_ASSIGN(const auto now, pictures());
  auto labels = blend_.place_seams(now);
  heads_.clear();
  return labels;
}

}  // namespace nodal::film
