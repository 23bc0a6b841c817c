// The fields of other programs' formats, and what an import does with each. One table for each format; a field that is
// in no table is named to the user.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::interchange {

enum class FieldUse : std::uint8_t {
  kUsed,      ///< changes the calibration, the pictures' names or the control points
  kNoted,     ///< describes a head or the pictures in a way that Nodal cannot hold: left out with a note
  kRefused,   ///< without it the import would be wrong
  kUnneeded,  ///< concerns the other program's output, interface or sound, and describes no head
};

struct KnownField {
  std::string_view place;  ///< the kind of line, the object or the file in which the field stands
  std::string_view name;   ///< ends in * for all names with this beginning
  FieldUse use;
  std::string_view meaning;  ///< a noun phrase; for kNoted the note's text
  /// kNoted, kRefused: values with which the field says nothing, with | between them; numbers are compared as numbers,
  /// also those of a list. "0..." stands for a list of zeros of any length, "4*" for any number of digits 4.
  std::string_view neutral = {};
};

/// A format's table.
struct KnownFormat {
  std::string_view program;
  std::string_view specification;  ///< where its fields are from
  std::span<const KnownField> fields;
};

const KnownFormat& hugin_fields();
const KnownFormat& ptgui_fields();
const KnownFormat& videostitch_fields();
const KnownFormat& surround360_fields();
const KnownFormat& opencv_fields();
const KnownFormat& kalibr_fields();
const KnownFormat& ocam_fields();
std::span<const KnownFormat* const> known_formats();

/// The fields of one file, compared with its format's table.
class FieldCheck {
 public:
  explicit FieldCheck(const KnownFormat& format) : format_(format) {}

  /// `value` is the field's text, empty if it has none; `whose` names the head or input in the note, or is empty.
  void see(std::string_view place, std::string_view name, std::string_view value, const std::string& whose = {});

  /// Adds a note for each field that is left out, and one for all fields that are in no table.
  /// Errors: kUnsupported for the first field that is refused.
  Status tell(std::vector<std::string>& notes) const;

 private:
  struct Seen {
    std::string name;   ///< its name in the file
    std::string value;  ///< the first one that is not neutral
    std::string whose;  ///< the first one's
    std::size_t count = 0;
  };
  const KnownFormat& format_;
  std::map<const KnownField*, Seen> left_out_;
  std::map<std::string, Seen> unknown_;  ///< by place and name
};

}  // namespace nodal::interchange
