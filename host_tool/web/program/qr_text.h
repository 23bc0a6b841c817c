// A QR code for a terminal.
#pragma once

#include <string>

namespace nodal::host::web {

/// Dark modules as blanks on light ones, two rows in a line, as the inverse of a terminal with light text on a dark
/// ground; with the quiet zone of four modules. Empty if the text does not fit.
std::string qr_text(const std::string& text);

}  // namespace nodal::host::web
