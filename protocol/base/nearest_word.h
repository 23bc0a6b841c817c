// "Did you mean": the known word that is nearest to a misspelt one.
#pragma once

#include <span>
#include <string_view>

namespace nodal {

/// The word of `known` that needs the fewest single-letter changes, when they are few enough to be a typing error.
std::string_view nearest_word(std::string_view word, std::span<const std::string_view> known);

}  // namespace nodal
