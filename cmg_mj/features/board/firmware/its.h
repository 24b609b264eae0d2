/* The exported controller under names that do not hang on the observer's: ITS(_update) is linear_update where the compiler
 * is told -DOBSERVER=linear. It is also told the parts of an estimate, -DESTIMATES=LINEAR_ESTIMATES, and the encoders. */
#ifndef ITS_H
#define ITS_H

#define QUOTED_(x) #x
#define QUOTED(x) QUOTED_(x)
#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define ITS(x) JOINED(OBSERVER, x)
#include QUOTED(OBSERVER.h)

typedef ITS(_real) real;

#endif
