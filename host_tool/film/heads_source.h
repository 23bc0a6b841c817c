// The raymaps of a film from the films of the heads.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "host_tool/film/film_blend.h"
#include "host_tool/film/frame_source.h"
#include "host_tool/film/head_film.h"

namespace nodal::film {

/// Ownership: refers to the plan and to the programs.
class HeadsSource final : public FrameSource {
 public:
  /// As FilmBlend::make().
  static Result<std::unique_ptr<HeadsSource>> make(const FilmPlan& plan, const Programs& programs, int threads,
                                                   const std::function<void(double)>& progress);
  Status begin(std::uint64_t segment) override;
  Status next(std::span<std::uint8_t> into) override;
  std::vector<std::string> finish() override;
  Result<std::vector<std::uint8_t>> place_seams(std::uint64_t segment) override;
  double seconds() const override { return blend_.seconds(); }

 private:
  HeadsSource(const FilmPlan& plan, const Programs& programs, FilmBlend blend)
      : plan_(plan), programs_(programs), blend_(std::move(blend)) {}
  Status open_heads();
  bool is_far() const;
  /// The heads' pictures of the next frame.
  Result<std::vector<ImageView>> pictures();

  const FilmPlan& plan_;
  const Programs& programs_;
  FilmBlend blend_;
  std::vector<std::unique_ptr<HeadFilm>> heads_;
  std::vector<std::uint64_t> replaced_;  ///< frames that decoders could not give, of those that have ended
  std::uint64_t begin_ = 0, frame_ = 0;  ///< the segment's first frame, and the next one
};

}  // namespace nodal::film
