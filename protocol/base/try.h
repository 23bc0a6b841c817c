// Passing an error on, in one statement.
//
// They are macros, because only these can return from the function that uses them.
#pragma once

#include <utility>

#include "protocol/base/result.h"

#define NODAL_TRY_JOINED(a, b) a##b
#define NODAL_TRY_NAME(line) NODAL_TRY_JOINED(nodal_try_, line)
#define NODAL_TRY_ASSIGN_AS(result, declaration, ...)           \
  auto result = (__VA_ARGS__);                                  \
  if (!result) return ::nodal::fail(std::move(result).error()); \
  declaration = *std::move(result)

/// Evaluates a Status or Result; when it is an error, returns it from the function, which returns a Status or Result,
/// too.
///
///     NODAL_TRY(disk.sync());
#define NODAL_TRY(...)                                                  \
  do {                                                                  \
    auto nodal_try = (__VA_ARGS__);                                     \
    if (!nodal_try) return ::nodal::fail(std::move(nodal_try).error()); \
  } while (false)

/// The same, and declares a variable with the value. It is several statements, so it stands in a block of its own
/// lines, never as the only statement of an if or a loop.
///
///     NODAL_TRY_ASSIGN(const std::string text, read_file(path));
#define NODAL_TRY_ASSIGN(declaration, ...) NODAL_TRY_ASSIGN_AS(NODAL_TRY_NAME(__LINE__), declaration, __VA_ARGS__)
