// The fields of Panorama Tools' lines, for FieldCheck.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/interchange/known_fields.h"
#include "stitch/interchange/panotools_script.h"

namespace nodal::interchange {

struct Attribute {
  std::string name;
  std::string value;  ///< empty if it has none
};

/// The words of "cropFactor=1 disabled".
std::vector<Attribute> attributes_of(std::string_view text);

/// The letters and underscores at the beginning, and the rest as the value: "optimizer 0", "imgrotate444".
Attribute setting_of(std::string_view text);

/// Shows the check all variables of a line; the place is the line's letter.
void see_variables(const ScriptLine& line, FieldCheck& check);

/// Shows the check all variables of an image, with links resolved.
/// Errors: those of ImageLines::find_number().
Status see_image(const ImageLines& images, std::size_t image, std::string_view place, const std::string& whose,
                 FieldCheck& check);

}  // namespace nodal::interchange
