// Read the addresses of the numbers in Python arrays.  The number type, the shape and
// the memory order of each array are checked.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <initializer_list>
#include <string>

namespace nb = nanobind;

// A number of rows that several arrays share.  The first array sets the value; -1 means
// that no array has been read.
struct Size {
    int64_t value = -1;
};

inline bool fits(Size &wanted, int64_t found) {
    if (wanted.value < 0) wanted.value = found;
    return wanted.value == found;
}
inline bool fits(int64_t wanted, int64_t found) { return wanted == found; }

inline std::string text(const Size &size) {
    return size.value < 0 ? "any" : std::to_string(size.value);
}
inline std::string text(int64_t size) { return std::to_string(size); }

// Raise a ValueError.  Its message names the argument, the array that was found and the
// array that was expected.
[[noreturn]] inline void refuse(
    nb::handle given, const char *name, std::string dtype, bool written,
    std::initializer_list<std::string> sizes) {
    const auto string_of = [](nb::object object) {
        return std::string(nb::str(object).c_str());
    };
    std::string found = string_of(given.type().attr("__name__")), wanted;
    if (nb::hasattr(given, "shape") && nb::hasattr(given, "dtype")) {
        found = string_of(given.attr("dtype")) + " of shape " +
                string_of(given.attr("shape"));
        if (nb::hasattr(given, "flags")) {
            const nb::object flags = given.attr("flags");
            if (!nb::cast<bool>(flags.attr("c_contiguous"))) found += ", not contiguous";
            if (written && !nb::cast<bool>(flags.attr("writeable"))) found += ", read-only";
        }
    }
    for (const std::string &size : sizes) wanted += (wanted.empty() ? "" : ", ") + size;
    if (sizes.size() == 1) wanted += ",";
    throw nb::value_error(
        (std::string(name) + ": " + found + ", expected " + (written ? "writable " : "") +
         dtype + " of shape (" + wanted + "), row after row")
            .c_str());
}

// Return the address of an array's numbers; null for an empty array.  The array must be
// writable unless T is const.
template <typename T, typename... Sizes>
T *address(nb::handle given, const char *name, Sizes &&...sizes) {
    nb::ndarray<T, nb::c_contig, nb::device::cpu> found;
    bool right = nb::try_cast(given, found, false) && found.ndim() == sizeof...(sizes);
    size_t axis = 0;
    if (right) ((right = fits(sizes, int64_t(found.shape(axis++))) && right), ...);
    constexpr bool real = std::is_same_v<std::remove_const_t<T>, double>;
    if (!right)
        refuse(given, name, real ? "float64" : "int64", !std::is_const_v<T>, {text(sizes)...});
    return found.size() ? found.data() : nullptr;
}

template <typename... Sizes>
const double *reals(nb::handle given, const char *name, Sizes &&...sizes) {
    return address<const double>(given, name, std::forward<Sizes>(sizes)...);
}
template <typename... Sizes>
const int64_t *integers(nb::handle given, const char *name, Sizes &&...sizes) {
    return address<const int64_t>(given, name, std::forward<Sizes>(sizes)...);
}

// Read indices; each index must be at least 0 and below the limit.
inline const int64_t *indices(
    nb::handle given, const char *name, int64_t limit, Size &size) {
    const int64_t *all = integers(given, name, size);
    for (int64_t i = 0; i < size.value; ++i)
        if (all[i] < 0 || all[i] >= limit)
            throw nb::value_error(
                (std::string(name) + "[" + std::to_string(i) + "] is " +
                 std::to_string(all[i]) + ", expected at least 0 and below " +
                 std::to_string(limit))
                    .c_str());
    return all;
}

// Read the first row of each group; the last number is the end of the last group.  The
// numbers must begin at 0, must not decrease and must not exceed the limit.  If
// `whole`, the last number must equal the limit.
inline const int64_t *starts(
    nb::handle given, const char *name, int64_t limit, bool whole, Size &size) {
    const int64_t *all = integers(given, name, size);
    bool right = size.value > 0 && all[0] == 0 && all[size.value - 1] <= limit;
    right = right && (!whole || all[size.value - 1] == limit);
    for (int64_t i = 1; right && i < size.value; ++i) right = all[i] >= all[i - 1];
    if (!right)
        throw nb::value_error(
            (std::string(name) + ": expected numbers that begin at 0, do not fall and end " +
             (whole ? "at " : "at most at ") + std::to_string(limit))
                .c_str());
    return all;
}
