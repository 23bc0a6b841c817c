// Blends the heads' pictures of a film to raymaps, with the seams that are in force.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "host_tool/film/film_plan.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "stitch/parallel/workers.h"
#include "stitch/sets/set_blend.h"

namespace nodal::film {

/// The same tables and kernels as a rig's board and `nodal render`. The bytes do not depend on the number of threads.
///
/// Threading: thread-bound; starts its own threads and waits for them.
/// Ownership: does not refer to the plan after make().
/// Errors: those of sets::PlanJob.
class FilmBlend {
 public:
  /// `threads` 0: one per core. `progress`: the part of the table that is compiled, 0 .. 1.
  static Result<FilmBlend> make(const FilmPlan& plan, int threads, const std::function<void(double)>& progress = {});

  /// Puts a segment's seams in force.
  Status use(const PlannedSeams* seams);
  /// Light of the heads in the pictures that are blended next, from their mean; by head. Empty: all are equal.
  void set_light(std::vector<Stops> light) { light_ = std::move(light); }
  /// Seams where these pictures agree; they stay as they are in force unless others are clearly better. Empty: they
  /// stay.
  Result<std::vector<std::uint8_t>> place_seams(std::span<const ImageView> pictures);
  /// `into`: packed_size() bytes of the raymap's format.
  void blend(std::span<const ImageView> pictures, std::uint8_t* into);
  /// Seconds that blend() took so far.
  double seconds() const { return seconds_; }

 private:
  explicit FilmBlend(int threads) : workers_(threads) {}
  void begin(std::span<const ImageView> pictures, bool views);
  void run();

  parallel::Workers workers_;
  sets::PlanPtr own_;  ///< with the calibration's own seams
  sets::SetBlend blend_;
  std::vector<Stops> light_;
  double seconds_ = 0;
};

}  // namespace nodal::film
