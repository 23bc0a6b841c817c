// Text in XML and HTML.
#pragma once

#include <string>
#include <string_view>

namespace nodal::media {

/// Also for text between double quotes.
std::string xml_escaped(std::string_view text);

}  // namespace nodal::media
