// "Did you mean": the known word that is nearest to a misspelt one.
#pragma once

#include <span>
#include <string_view>

namespace nodal {

/// The word of `known` with the smallest edit distance, if that is small enough for a typing error; else empty.
std::string_view nearest_word(std::string_view word, std::span<const std::string_view> known);

}  // namespace nodal
