// Where the frames of a film come from.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::film {

/// Makes the raymaps of a plan: from the heads' films, or from a take. For each segment begin(), then next() for each
/// of its frames, then finish(). The bytes of a segment depend on the plan and on the source's files only, never on
/// which segments were made before.
///
/// Threading: thread-bound; may start threads of its own.
/// Errors: those of the files, each with the file's name.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Goes to the first frame of a segment, and puts the segment's seams in force.
  virtual Status begin(std::uint64_t segment) = 0;
  /// `into`: packed_size() bytes of the coded format.
  virtual Status next(std::span<std::uint8_t> into) = 0;
  /// Ends the segment. Whole sentences for the user: what could not be shown.
  virtual std::vector<std::string> finish() = 0;

  /// Labels of the seams that suit the segment's first frame, near those of the segment before. Empty: they stay.
  virtual Result<std::vector<std::uint8_t>> place_seams(std::uint64_t segment) = 0;
  /// Seconds that blending took so far.
  virtual double seconds() const = 0;
};

}  // namespace nodal::film
