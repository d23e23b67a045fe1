// Counters that many invocations of a group add to: numbers of `counts`, a buffer of the shader. They are counted in shared
// memory, where neighbours, which have their last bits apart, have a place each; those that find theirs taken are counted in
// the buffer.

const uint PLACES = 1024, EMPTY = 0xFFFFFFFFu;

shared uint holder[PLACES], held[PLACES]; // which counter has the place, and what it has more

// All invocations of a group of `size`, before and after the others.
void tally_begin(uint size)
{
    for (uint i = gl_LocalInvocationIndex; i < PLACES; i += size) {
        holder[i] = EMPTY;
        held[i] = 0;
    }
    barrier();
}

void tally(uint counter)
{
    const uint place = counter % PLACES;
    uint other = holder[place];

    if (other == EMPTY)
        other = atomicCompSwap(holder[place], EMPTY, counter);
    if (other == EMPTY || other == counter)
        atomicAdd(held[place], 1);
    else
        atomicAdd(counts[counter], 1);
}

void tally_end(uint size)
{
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < PLACES; i += size) {
        if (held[i] != 0)
            atomicAdd(counts[holder[i]], held[i]);
    }
}
