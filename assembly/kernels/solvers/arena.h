// Arrays of a thread of a device, in its own room: the stack of a thread, which a device
// keeps side by side with those of its neighbours, so that they read it together.
//
// Nothing is given back one by one: an array that is dropped leaves its room taken until
// the thread goes back to a mark, between two problems.  What the room does not hold is
// on the heap until then.
#pragma once

#include "standard.h"

class Arena {
public:
    struct Mark { size_t used; void *heap; };

    void begin(char *first, size_t bytes) { room = first, size = bytes, used = 0, heap = nullptr; }
    Mark mark() const { return {used, heap}; }
    void back_to(Mark mark) {
        used = mark.used;
        while (heap != mark.heap) {
            void **block = static_cast<void **>(heap);
            heap = *block;
            free(block);
        }
    }
    void *take(size_t bytes) {
        bytes = (bytes + 15) / 16 * 16;
        if (used + bytes <= size) {
            used += bytes;
            return room + used - bytes;
        }
        void **block = static_cast<void **>(malloc(bytes + 16));
        if (!block) abort();
        *block = heap;  // each knows the one before
        heap = block;
        return block + 2;
    }

private:
    char *room;
    size_t size, used;
    void *heap;
};

#ifdef __CUDACC_RTC__
constexpr int THREADS = 64;  // of a block
__shared__ Arena arenas[THREADS];
inline Arena &arena() { return arenas[threadIdx.x]; }
#else
inline Arena &arena() {
    static thread_local Arena own;
    return own;
}
#endif

// As much of std::vector as is used.
template <typename T> class Array {
public:
    Array() = default;
    explicit Array(size_t count) : Array(count, T()) {}
    Array(size_t count, const T &value) {
        reserve(count);
        for (; length < count; ++length) new_at(length, value);
    }
    Array(const Array &other) { copy(other); }
    Array &operator=(const Array &other) {
        length = 0;
        copy(other);
        return *this;
    }

    void push_back(const T &value) {
        if (length == room) reserve(2 * length + 1);
        new_at(length++, value);
    }
    size_t size() const { return length; }
    bool empty() const { return length == 0; }
    T *data() { return first; }
    const T *data() const { return first; }
    T *begin() { return first; }
    T *end() { return first + length; }
    const T *begin() const { return first; }
    const T *end() const { return first + length; }
    T &operator[](size_t i) { return first[i]; }
    const T &operator[](size_t i) const { return first[i]; }

private:
    T *first = nullptr;
    size_t length = 0, room = 0;

    void new_at(size_t i, const T &value) {
        first[i] = value;  // every T here is numbers and pointers: zeros are one, too
    }
    void reserve(size_t count) {
        if (count <= room) return;
        T *more = static_cast<T *>(arena().take(count * sizeof(T)));
        char *bytes = reinterpret_cast<char *>(more);
        for (size_t i = 0; i < count * sizeof(T); ++i) bytes[i] = 0;
        for (size_t i = 0; i < length; ++i) more[i] = first[i];
        first = more, room = count;
    }
    void copy(const Array &other) {
        reserve(other.length);
        for (; length < other.length; ++length) first[length] = other.first[length];
    }
};
